//! A path or a URL: the one place that tells them apart.

use std::{ffi::OsString, fmt, path::PathBuf};

/// Where a log or a dataset lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    Local(PathBuf),
    Remote(ObjectUrl),
}

/// `s3://bucket/key`: an object, or all below a prefix. Keys are taken as they are, without
/// percent-decoding, as the tools of the stores do.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ObjectUrl {
    /// `s3`, in small letters.
    pub scheme: String,
    /// `s3://bucket`.
    pub root: String,
    /// Without slashes at its ends; empty for the whole bucket.
    pub key: String,
}

impl From<OsString> for Location {
    /// Whatever begins like `scheme://` is a URL, and all else is a path.
    fn from(text: OsString) -> Location {
        match text.to_str().and_then(ObjectUrl::parse) {
            Some(url) => Location::Remote(url),
            None => Location::Local(PathBuf::from(text)),
        }
    }
}

impl ObjectUrl {
    /// `None` for what is no URL.
    pub fn parse(text: &str) -> Option<ObjectUrl> {
        let (scheme, rest) = text.split_once("://")?;
        let is_scheme_letter = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
        if !scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            || !scheme.chars().all(is_scheme_letter)
        {
            return None;
        }
        let scheme = scheme.to_ascii_lowercase();
        let (bucket, key) = rest.split_once('/').unwrap_or((rest, ""));
        let (root, key) = (format!("{scheme}://{bucket}"), key.trim_matches('/').to_string());
        Some(ObjectUrl { scheme, root, key })
    }

    /// The URL of another key of the same bucket.
    pub fn with_key(&self, key: &str) -> ObjectUrl {
        ObjectUrl { key: key.to_string(), ..self.clone() }
    }
}

impl fmt::Display for ObjectUrl {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.key.is_empty() {
            true => f.write_str(&self.root),
            false => write!(f, "{}/{}", self.root, self.key),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_told_from_paths() {
        let paths = [
            "drives",
            "/a/b.mcap",
            "./s3:/b",
            "s3:/b/c",
            "C:\\drives",
            "://b",
            "3s://b",
            "a b://c",
        ];
        for path in paths {
            assert_eq!(Location::from(OsString::from(path)), Location::Local(PathBuf::from(path)));
        }
        for (text, root, key) in [
            ("s3://b", "s3://b", ""),
            ("S3://b/", "s3://b", ""),
            ("gs://b/drives/", "gs://b", "drives"),
            ("az://c/a b/%20.mcap", "az://c", "a b/%20.mcap"),
            (
                "abfss://c@account.dfs.core.windows.net/d",
                "abfss://c@account.dfs.core.windows.net",
                "d",
            ),
        ] {
            let Location::Remote(url) = Location::from(OsString::from(text)) else {
                panic!("{text} is a URL")
            };
            assert_eq!((url.root.as_str(), url.key.as_str()), (root, key));
        }
    }
}
