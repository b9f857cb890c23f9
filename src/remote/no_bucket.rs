//! In the place of `bucket` where pmp is built without the feature `remote`: there are no buckets.

use std::path::Path;

use crate::{
    error::{Error, Result},
    remote::location::ObjectUrl,
};

/// No bucket: there is no value of this type.
#[derive(Debug)]
pub enum Bucket {}

/// An object, as listed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    pub url: ObjectUrl,
    pub bytes: u64,
    pub e_tag: Option<String>,
}

impl Bucket {
    /// # Errors
    ///
    /// [`Error::Remote`], always.
    pub fn open(url: &ObjectUrl) -> Result<Bucket> {
        Err(Error::Remote {
            action: "open",
            url: url.to_string(),
            why: "pmp was built without object stores".to_string(),
            hint: "build it with the feature `remote` (on by default), or copy the files to a \
                   local folder"
                .to_string(),
        })
    }

    pub fn find(&self, _key: &str) -> Result<Option<Object>> {
        match *self {}
    }

    pub fn list(&self, _prefix: &str) -> Result<Vec<Object>> {
        match *self {}
    }

    pub fn read(
        &self,
        _object: &Object,
        _on_piece: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        match *self {}
    }

    pub fn sha256(&self, _object: &Object) -> Result<String> {
        match *self {}
    }

    pub fn send(
        &self,
        _file: &Path,
        _key: &str,
        _sha256: &str,
        _on_bytes: &dyn Fn(u64),
    ) -> Result<()> {
        match *self {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_is_an_error_that_says_how_to_build_stores_in() {
        let url = ObjectUrl::parse("s3://bucket/drives").unwrap();
        let error = Bucket::open(&url).unwrap_err();
        assert_eq!(
            error.to_string(),
            "cannot open s3://bucket/drives: pmp was built without object stores"
        );
        assert!(error.hint().unwrap().contains("feature `remote`"));
    }
}
