//! Requests to object stores, by the crate `object_store`, which is asynchronous: that ends here.
//!
//! Credentials and endpoints come from the environment (`AWS_*`, `GOOGLE_*`, `AZURE_*`), as the
//! tools of the stores have them. Requests are retried a few times, for some seconds.

use std::{fs::File, io::Read, path::Path, sync::Arc, time::Duration};

use futures_util::{StreamExt, stream};
use object_store::{
    Attribute, Attributes, BackoffConfig, Error as StoreError, GetOptions, ObjectMeta, ObjectStore,
    PutMode, PutMultipartOptions, PutOptions, PutPayload, RetryConfig, WriteMultipart,
    aws::AmazonS3Builder, azure::MicrosoftAzureBuilder, gcp::GoogleCloudStorageBuilder,
    path::Path as Key,
};
use sha2::{Digest, Sha256};
use tokio::runtime::{Builder, Runtime};

use crate::{
    atomic::hex,
    error::{Error, Result},
    remote::location::ObjectUrl,
};

/// Objects are read and sent in pieces of this size, so that memory is bounded and no request
/// takes long. S3 takes no smaller ones than 5 MiB.
const PIECE_BYTES: usize = 8 << 20;

/// Pieces that are under way at once.
const PIECES_AT_ONCE: usize = 2;

/// Under this name an object carries its SHA-256 with it.
const SHA256_NAME: &str = "sha256";

/// A bucket (Azure: a container) of a store.
pub struct Bucket {
    root: ObjectUrl,
    store: Arc<dyn ObjectStore>,
    runtime: Runtime,
}

/// An object, as listed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    pub url: ObjectUrl,
    pub bytes: u64,
    /// Changes with the content.
    pub e_tag: Option<String>,
}

impl Bucket {
    /// The bucket of a URL; no request is made yet.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store is none of the three, or its settings make no sense.
    pub fn open(url: &ObjectUrl) -> Result<Bucket> {
        let root = url.with_key("");
        let retry = || RetryConfig {
            backoff: BackoffConfig { max_backoff: Duration::from_secs(4), ..Default::default() },
            max_retries: 6,
            retry_timeout: Duration::from_secs(20),
        };
        let text = root.to_string();
        let store: Result<Arc<dyn ObjectStore>, StoreError> = match url.scheme.as_str() {
            "s3" | "s3a" => AmazonS3Builder::from_env()
                .with_url(text)
                .with_retry(retry())
                .build()
                .map(|store| Arc::new(store) as _),
            "gs" => GoogleCloudStorageBuilder::from_env()
                .with_url(text)
                .with_retry(retry())
                .build()
                .map(|store| Arc::new(store) as _),
            "az" | "azure" | "adl" | "abfs" | "abfss" => MicrosoftAzureBuilder::from_env()
                .with_url(text)
                .with_retry(retry())
                .build()
                .map(|store| Arc::new(store) as _),
            _ => {
                let why = format!("{}:// is no object store that pmp knows", url.scheme);
                let hint = "give a path, or a URL that begins with s3://, gs:// or az://";
                let url = url.to_string();
                return Err(Error::Remote { action: "open", url, why, hint: hint.to_string() });
            }
        };
        let store = store.map_err(|error| refused("open", url, &error))?;
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(Error::io("open", url.to_string()))?;
        Ok(Bucket { root, store, runtime })
    }

    /// The object of exactly this key, if there is one.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store refuses or cannot be reached.
    pub fn find(&self, key: &str) -> Result<Option<Object>> {
        let url = self.root.with_key(key);
        let options = GetOptions { head: true, ..Default::default() };
        match self.runtime.block_on(self.store.get_opts(&parse(&url)?, options)) {
            Ok(found) => Ok(Some(self.object(found.meta))),
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(refused("find", &url, &error)),
        }
    }

    /// All objects below a prefix, by their keys.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store refuses or cannot be reached.
    pub fn list(&self, prefix: &str) -> Result<Vec<Object>> {
        let url = self.root.with_key(prefix);
        let mut listing = self.store.list(Some(&parse(&url)?));
        let mut objects = Vec::new();
        while let Some(meta) = self.runtime.block_on(listing.next()) {
            objects.push(self.object(meta.map_err(|error| refused("list", &url, &error))?));
        }
        objects.sort_by(|a, b| a.url.cmp(&b.url));
        Ok(objects)
    }

    fn object(&self, meta: ObjectMeta) -> Object {
        let url = self.root.with_key(meta.location.as_ref());
        Object { url, bytes: meta.size, e_tag: meta.e_tag }
    }

    /// Read an object, piece by piece in its order.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store refuses, or the object changes meanwhile; and whatever
    /// `on_piece` returns.
    pub fn read(
        &self,
        object: &Object,
        on_piece: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        let key = parse(&object.url)?;
        let starts = (0..object.bytes).step_by(PIECE_BYTES);
        let mut pieces = stream::iter(starts.map(|start| {
            let end = object.bytes.min(start + PIECE_BYTES as u64);
            let options = GetOptions {
                if_match: object.e_tag.clone(),
                range: Some((start..end).into()),
                ..Default::default()
            };
            let key = &key;
            async move { self.store.get_opts(key, options).await?.bytes().await }
        }))
        .buffered(PIECES_AT_ONCE);
        while let Some(piece) = self.runtime.block_on(pieces.next()) {
            on_piece(&piece.map_err(|error| refused("read", &object.url, &error))?)?;
        }
        Ok(())
    }

    /// The SHA-256 of an object: that which it was sent with, else of its bytes, which are read.
    ///
    /// # Errors
    ///
    /// [`Error::Remote`] if the store refuses or cannot be reached.
    pub fn sha256(&self, object: &Object) -> Result<String> {
        let options = GetOptions { head: true, ..Default::default() };
        let found = self.runtime.block_on(self.store.get_opts(&parse(&object.url)?, options));
        let found = found.map_err(|error| refused("examine", &object.url, &error))?;
        if let Some(sha256) = found.attributes.get(&Attribute::Metadata(SHA256_NAME.into())) {
            return Ok(sha256.to_string());
        }
        let mut hasher = Sha256::new();
        self.read(object, &mut |piece| {
            hasher.update(piece);
            Ok(())
        })?;
        Ok(hex(&hasher.finalize()))
    }

    /// Send a file, which is there when it is whole. A file of one piece takes no other's place.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be read, [`Error::Remote`] if the store refuses.
    pub fn send(&self, file: &Path, key: &str, sha256: &str, on_bytes: &dyn Fn(u64)) -> Result<()> {
        let url = self.root.with_key(key);
        let key = parse(&url)?;
        let refuse = |error| refused("write", &url, &error);
        let attributes: Attributes =
            [(Attribute::Metadata(SHA256_NAME.into()), sha256.to_string())].into_iter().collect();
        let mut reader = File::open(file).map_err(Error::io("open", file))?;
        let mut next_piece = || {
            let mut piece = Vec::new();
            let part = Read::by_ref(&mut reader).take(PIECE_BYTES as u64);
            { part }.read_to_end(&mut piece).map_err(Error::io("read", file))?;
            Ok::<_, Error>(piece)
        };
        let first = next_piece()?;
        if first.len() < PIECE_BYTES {
            let len = first.len() as u64;
            let options = PutOptions { mode: PutMode::Create, attributes, ..Default::default() };
            let sent = self.store.put_opts(&key, PutPayload::from(first), options);
            self.runtime.block_on(sent).map_err(refuse)?;
            on_bytes(len);
            return Ok(());
        }
        let options = PutMultipartOptions { attributes, ..Default::default() };
        let upload = self.runtime.block_on(self.store.put_multipart_opts(&key, options));
        let upload = upload.map_err(refuse)?;
        // `WriteMultipart` spawns its requests.
        let _context = self.runtime.enter();
        let mut upload = WriteMultipart::new_with_chunk_size(upload, PIECE_BYTES);
        let mut send_pieces = |mut piece: Vec<u8>| {
            while !piece.is_empty() {
                let len = piece.len() as u64;
                upload.put(piece.into());
                let sent = upload.wait_for_capacity(PIECES_AT_ONCE);
                self.runtime.block_on(sent).map_err(refuse)?;
                on_bytes(len);
                piece = next_piece()?;
            }
            Ok(())
        };
        match send_pieces(first) {
            Ok(()) => self.runtime.block_on(upload.finish()).map(|_| ()).map_err(refuse),
            Err(error) => {
                // Pieces without an end would stay in the store, unseen. Why they have none is the
                // error to tell.
                let _ = self.runtime.block_on(upload.abort());
                Err(error)
            }
        }
    }
}

fn parse(url: &ObjectUrl) -> Result<Key> {
    Key::parse(&url.key).map_err(|error| refused("name", url, &error.into()))
}

/// What a store says, in a sentence, and what to do about it.
fn refused(action: &'static str, url: &ObjectUrl, error: &StoreError) -> Error {
    let (settings, plain_http) = match url.scheme.as_str() {
        "gs" => ("GOOGLE_APPLICATION_CREDENTIALS", "GOOGLE_ALLOW_HTTP"),
        "s3" | "s3a" => (
            "AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION, AWS_ENDPOINT_URL",
            "AWS_ALLOW_HTTP",
        ),
        _ => ("AZURE_STORAGE_ACCOUNT_NAME, AZURE_STORAGE_ACCOUNT_KEY", "AZURE_ALLOW_HTTP"),
    };
    let cause = innermost_cause(error);
    // A listing that is refused has no kind of its own.
    let has_status = |codes: &[&str]| codes.iter().any(|code| cause.contains(code));
    let hint = match error {
        StoreError::Precondition { .. } => {
            "it was changed meanwhile: give the command again when nobody writes there".to_string()
        }
        StoreError::AlreadyExists { .. } => {
            "another process wrote there meanwhile: choose another --out".to_string()
        }
        StoreError::InvalidPath { .. } => {
            "give a key without empty parts, `.` and `..`".to_string()
        }
        _ if has_status(&["404 Not Found"]) => {
            format!("are the bucket and the key spelt right, and is it this store ({settings})?")
        }
        _ if has_status(&["401 Unauthorized", "403 Forbidden"]) => {
            format!(
                "set the credentials of somebody who may do this in the environment: {settings}"
            )
        }
        _ => format!(
            "are the network and the settings in the environment right ({settings}; \
             {plain_http}=true for http://)? Given again, the same command goes on"
        ),
    };
    Error::Remote { action, url: url.to_string(), why: said_by_store(&cause), hint }
}

fn innermost_cause(error: &StoreError) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

/// Of an answer in XML, what its elements say.
fn said_by_store(text: &str) -> String {
    let element = |name: &str| {
        let (_, rest) = text.split_once(&format!("<{name}>"))?;
        rest.split_once("</").map(|(content, _)| content.trim().to_string())
    };
    match (element("Code"), element("Message")) {
        (Some(code), Some(message)) => format!("{code}: {message}"),
        (Some(code), None) => code,
        _ => text.trim().trim_end_matches(':').to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_store_is_opened_by_its_scheme_and_others_are_refused() {
        let open = |text| Bucket::open(&ObjectUrl::parse(text).unwrap());
        for (url, store) in [
            ("s3://bucket/a/b", "AmazonS3(bucket)"),
            ("gs://bucket/a/b", "GoogleCloudStorage(bucket)"),
            (
                "abfss://data@account.dfs.core.windows.net/a/b",
                "MicrosoftAzure { account: account, container: data }",
            ),
        ] {
            let bucket = open(url).map_err(|error| error.to_string()).unwrap();
            assert_eq!(bucket.store.to_string(), store);
            assert_eq!(bucket.root.with_key("a/b").to_string(), url);
        }
        let error = open("ftp://host/a").err().unwrap();
        assert!(error.to_string().contains("no object store"), "{error}");
    }

    #[test]
    fn of_an_answer_in_xml_its_elements_are_told() {
        let xml = "Server returned non-2xx status code: 404 Not Found: <?xml?><Error><Code>NoSuchBucket\
                   </Code><Message> It is not there </Message></Error>";
        assert_eq!(said_by_store(xml), "NoSuchBucket: It is not there");
        assert_eq!(said_by_store("<Code>Busy</Code>"), "Busy");
        assert_eq!(said_by_store("status 403: "), "status 403");
    }
}
