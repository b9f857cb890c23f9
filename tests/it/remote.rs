//! Logs and datasets in an object store, against servers and clients that others wrote.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    net::TcpListener,
    path::Path,
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::{Value as Json, json};

use crate::{
    fixtures::{Cdr, DriveLog, mcap_bytes},
    ingest::{PROGRAM, Said, into, names, same_trees, text, three_logs},
    writers::python,
};

/// moto's S3, with boto3 beside it; see tests/peers/object_store.py.
struct Store {
    process: Child,
    commands: ChildStdin,
    answers: BufReader<ChildStdout>,
    endpoint: String,
}

impl Store {
    /// `None` where its packages are absent.
    fn start() -> Option<Store> {
        let has = Command::new(python()).args(["-c", "import boto3, flask, moto.server"]).output();
        if !has.is_ok_and(|output| output.status.success()) {
            println!("skipped: {} has not moto[server]", python());
            return None;
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/object_store.py");
        let mut process = Command::new(python())
            .arg(script)
            // moto asks for credentials when so many requests were made.
            .env("INITIAL_NO_AUTH_ACTION_COUNT", "1000000")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let commands = process.stdin.take().unwrap();
        let mut answers = BufReader::new(process.stdout.take().unwrap());
        let mut port = String::new();
        answers.read_line(&mut port).unwrap();
        let endpoint = format!("http://127.0.0.1:{}", port.trim());
        Some(Store { process, commands, answers, endpoint })
    }

    fn tell(&mut self, command: Json) -> Json {
        writeln!(self.commands, "{command}").unwrap();
        let mut answer = String::new();
        self.answers.read_line(&mut answer).unwrap();
        serde_json::from_str(&answer).unwrap()
    }

    fn list(&mut self, prefix: &str) -> Vec<String> {
        serde_json::from_value(self.tell(json!(["list", prefix]))).unwrap()
    }

    /// Keys that were asked for by these methods since requests were last asked for, once each.
    fn asked(&mut self, methods: &[&str]) -> Vec<String> {
        let requests: Vec<(String, String)> =
            serde_json::from_value(self.tell(json!(["requests"]))).unwrap();
        let of_method = |(method, _): &(String, String)| methods.contains(&method.as_str());
        let mut keys: Vec<_> = requests.into_iter().filter(of_method).map(|(_, key)| key).collect();
        keys.sort();
        keys.dedup();
        keys
    }

    fn written(&mut self) -> Vec<String> {
        self.asked(&["PUT", "POST", "DELETE"])
    }

    /// Keys of objects whose bytes were read.
    fn read(&mut self) -> Vec<String> {
        let mut keys = self.asked(&["GET"]);
        keys.retain(|key| !key.is_empty());
        keys
    }

    fn ingest(&self, spool: &Path, arguments: &[&str]) -> Said {
        ingest_at(&self.endpoint, spool, arguments)
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// pmp-ingest, with nothing of this machine's own settings.
fn program(endpoint: &str, spool: &Path) -> Command {
    let mut command = Command::new(PROGRAM);
    command
        .env_clear()
        .env("AWS_ENDPOINT_URL", endpoint)
        .env("AWS_ALLOW_HTTP", "true")
        .env("AWS_ACCESS_KEY_ID", "test")
        .env("AWS_SECRET_ACCESS_KEY", "test")
        .env("GOOGLE_BASE_URL", endpoint)
        .env("GOOGLE_ALLOW_HTTP", "true")
        .env("GOOGLE_SKIP_SIGNATURE", "true")
        .env("TMPDIR", spool);
    command
}

fn ingest_at(endpoint: &str, spool: &Path, arguments: &[&str]) -> Said {
    let output = program(endpoint, spool).args(arguments).output().unwrap();
    Said {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// What lies in a spool folder, but for locks and known checksums.
fn left_in(spool: &Path) -> Vec<String> {
    let mut left = names(spool);
    left.retain(|name| !name.ends_with(".lock") && !name.contains("/known/"));
    left
}

#[test]
fn logs_below_a_prefix_and_a_dataset_below_a_url_have_the_bytes_of_local_ones() {
    let Some(mut store) = Store::start() else { return };
    let (folder, _logs) = three_logs(4.0);
    let logs = folder.path().join("logs");
    fs::create_dir_all(logs.join("a/b")).unwrap();
    fs::rename(folder.path().join("drive-0.mcap"), logs.join("a/b/drive-0.mcap")).unwrap();
    // In the order of paths, which is not that of letters, and more than a piece (8 MiB).
    fs::rename(folder.path().join("drive-1.mcap"), logs.join("a-drive.mcap")).unwrap();
    let padded = DriveLog { seconds: 3.0, picture_padding: 400_000, ..DriveLog::default() };
    assert!(fs::metadata(padded.write(&logs, "padded.mcap")).unwrap().len() > 10 << 20);
    fs::write(logs.join("broken.mcap"), b"no log").unwrap();
    fs::copy(logs.join("a/b/drive-0.mcap"), logs.join("again.mcap")).unwrap();
    fs::write(logs.join("notes.txt"), b"not for ingest").unwrap();
    store.tell(json!(["upload", text(&logs), "drives"]));
    let spool = folder.path().join("spool");
    fs::create_dir(&spool).unwrap();

    let local = folder.path().join("local");
    let whole = into(&local, &[&logs]);
    assert_eq!(whole.code, 3, "{}", whole.err);
    assert!(whole.err.contains("broken.mcap") && whole.err.contains("the same bytes"));
    for (name, jobs) in [("remote-1", "1"), ("remote-4", "4")] {
        let dataset = folder.path().join(name);
        let said =
            store.ingest(&spool, &["--jobs", jobs, "--out", text(&dataset), "s3://bucket/drives"]);
        assert_eq!((said.code, &said.err), (3, &whole.err));
        same_trees(&local, &dataset);
    }
    assert_eq!(left_in(&spool), [""; 0]);
    assert_eq!(store.written(), store.list("drives"), "boto3 wrote, and pmp did not");

    let to = "s3://bucket/made/data/";
    let said = store.ingest(&spool, &["--out", to, "s3://bucket/drives"]);
    assert_eq!((said.code, &said.err), (3, &whole.err));
    let back = folder.path().join("back");
    store.tell(json!(["download", "made/data", text(&back)]));
    same_trees(&local, &back);
    assert_eq!(left_in(&spool), [""; 0]);

    // Given again, it is answered with itself; nothing is written.
    store.written();
    let again = store.ingest(&spool, &["--out", to, "s3://bucket/drives"]);
    assert_eq!((again.code, &again.err), (3, &whole.err));
    // Other logs, or another rate, are refused.
    let other = DriveLog { seconds: 1.0, ..DriveLog::default() }.write(folder.path(), "o.mcap");
    let said = store.ingest(&spool, &["--out", to, text(&other)]);
    assert!(said.code == 1 && said.err.contains("a finished dataset, without "), "{}", said.err);
    let said = store.ingest(&spool, &["--out", to, "--rate", "5", "s3://bucket/drives"]);
    assert!(said.code == 1 && said.err.contains("made with another configuration"), "{}", said.err);
    let said = store.ingest(&spool, &["--out", "s3://bucket/drives", text(&other)]);
    assert!(said.code == 1 && said.err.contains("not empty and no dataset"), "{}", said.err);
    let said = store.ingest(&spool, &["--out", to, "--shard", "1/2", text(&other)]);
    assert!(said.code == 1 && said.err.contains("cannot share a dataset"), "{}", said.err);
    assert_eq!(store.written(), [""; 0]);
}

#[test]
fn a_sending_that_was_killed_is_gone_on_with() {
    let Some(mut store) = Store::start() else { return };
    let (folder, _logs) = three_logs(4.0);
    let local = folder.path().join("local");
    assert_eq!(into(&local, &[folder.path()]).code, 0);
    let spool = folder.path().join("spool");
    fs::create_dir(&spool).unwrap();
    store.tell(json!(["hold", "manifest.json"]));
    let mut child = program(&store.endpoint, &spool)
        .args(["--out", "s3://bucket/data", text(folder.path())])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while store.list("data/").len() < names(&local).len() - 1 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is being sent");
        thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!left_in(&spool).is_empty(), "the dataset is still there");
    store.tell(json!(["hold", ""]));
    store.tell(json!(["remove", "data/manifest.json"]));
    store.tell(json!(["remove", "data/logs/"]));
    store.written();

    let said = store.ingest(&spool, &["--out", "s3://bucket/data", text(folder.path())]);
    assert_eq!(said.code, 0, "{}", said.err);
    let written = store.written();
    let is_missing = |key: &String| key.starts_with("data/logs/") || key == "data/manifest.json";
    assert!(written.len() == 4 && written.iter().all(is_missing), "{written:?}");
    let back = folder.path().join("back");
    store.tell(json!(["download", "data", text(&back)]));
    same_trees(&local, &back);
    assert_eq!(left_in(&spool), [""; 0]);
}

#[test]
fn a_dataset_is_not_mixed_with_another_unfinished_one() {
    let Some(mut store) = Store::start() else { return };
    let (folder, logs) = three_logs(1.0);
    let spool = folder.path().join("spool");
    fs::create_dir(&spool).unwrap();
    assert_eq!(store.ingest(&spool, &["--out", "s3://bucket/data", text(&logs[0])]).code, 0);
    store.tell(json!(["remove", "data/manifest.json"]));
    store.written();
    let said = store.ingest(&spool, &["--out", "s3://bucket/data", text(&logs[1])]);
    assert!(
        said.code == 1 && said.err.contains("which is of no log given, lies here"),
        "{}",
        said.err
    );
    assert_eq!(store.written(), [""; 0]);

    // An object of the same name and size that holds something else.
    let back = folder.path().join("back");
    store.tell(json!(["download", "data", text(&back)]));
    let mut episodes = fs::read(back.join("episodes.parquet")).unwrap();
    episodes[100] ^= 1;
    fs::write(back.join("episodes.parquet"), episodes).unwrap();
    store.tell(json!(["upload", text(&back), "data"]));
    store.written();
    let elsewhere = folder.path().join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let arguments = ["--out", "s3://bucket/data", text(&logs[0])];
    let said = store.ingest(&elsewhere, &arguments);
    let expected = "error: another dataset's episodes.parquet lies here: s3://bucket/data\n";
    assert!(said.code == 1 && said.err.starts_with(expected), "{}", said.err);
    assert_eq!(store.written(), [""; 0]);
    // Where another dataset was made for this URL, and could not be sent, one is told of both.
    let said = store.ingest(&spool, &arguments);
    assert!(said.code == 1 && said.err.contains("an earlier command made for s3://bucket/data"));
}

#[test]
fn what_was_read_once_is_not_read_again_to_tell_that_it_is_committed() {
    let Some(mut store) = Store::start() else { return };
    let (folder, _logs) = three_logs(1.0);
    store.tell(json!(["upload", text(folder.path()), "drives"]));
    let (spool, dataset) = (folder.path().join("spool"), folder.path().join("data"));
    fs::create_dir(&spool).unwrap();
    let arguments = ["--out", text(&dataset), "s3://bucket/drives"];
    // Two are committed, and one is not.
    let share = store.ingest(&spool, &[&arguments[..], &["--shard", "1/2"]].concat());
    assert_eq!(share.code, 0, "{}", share.err);
    assert_eq!(store.read(), ["drives/drive-0.mcap", "drives/drive-2.mcap"]);
    let whole = store.ingest(&spool, &arguments);
    assert_eq!(whole.code, 0, "{}", whole.err);
    assert_eq!(store.read(), ["drives/drive-1.mcap"]);
    // With another spool folder nothing is known, and all are read to be told apart.
    let elsewhere = folder.path().join("elsewhere");
    let again = store.ingest(&spool, &[&arguments[..], &["--spool", text(&elsewhere)]].concat());
    assert_eq!((again.code, again.err), (0, whole.err));
    assert_eq!(store.read(), store.list("drives"));
}

#[test]
fn a_file_of_several_pieces_arrives_whole() {
    let Some(mut store) = Store::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let profile = folder.path().join("large.toml");
    fs::write(&profile, "[camera]\nwidth = 1200\nheight = 500\nquality = 100\n").unwrap();
    let drive = DriveLog { seconds: 6.0, ..DriveLog::default() };
    let mut messages = drive.messages();
    for (i, message) in messages.iter_mut().enumerate() {
        if message.type_name == "sensor_msgs/CompressedImage" {
            let noise = (0..60 * 25 * 3).map(|at| ((at * 2_654_435_761_u64) >> (i % 16)) as u8);
            let mut jpeg = Vec::new();
            let encoder = jpeg_encoder::Encoder::new(&mut jpeg, 90);
            let rgb: Vec<u8> = noise.collect();
            encoder.encode(&rgb, 60, 25, jpeg_encoder::ColorType::Rgb).unwrap();
            let mut cdr = Cdr::new(false);
            message.data =
                cdr.header(message.log_time_ns, "camera").text("jpeg").bytes(&jpeg).finish();
        }
    }
    let log = folder.path().join("drive.mcap");
    fs::write(&log, mcap_bytes(&messages, &drive.layout)).unwrap();
    let local = folder.path().join("local");
    let arguments = |out| ["--profile", text(&profile), "--out", out, text(&log)];
    assert_eq!(store.ingest(folder.path(), &arguments(text(&local))).code, 0);
    let bytes = |name: &String| fs::metadata(local.join(name)).unwrap().len();
    assert!(names(&local).iter().map(bytes).max() > Some(9 << 20));
    let said = store.ingest(folder.path(), &arguments("s3://bucket/data"));
    assert_eq!(said.code, 0, "{}", said.err);
    let back = folder.path().join("back");
    store.tell(json!(["download", "data", text(&back)]));
    same_trees(&local, &back);
}

#[test]
fn google_urls_list_and_read_as_well() {
    let Some(mut store) = Store::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let logs = folder.path().join("logs");
    let log = DriveLog { seconds: 1.0, ..DriveLog::default() };
    fs::create_dir(&logs).unwrap();
    log.write(&logs, "drive.mcap");
    store.tell(json!(["upload", text(&logs), "drives"]));
    let (local, remote) = (folder.path().join("local"), folder.path().join("remote"));
    assert_eq!(into(&local, &[&logs]).code, 0);
    let said = store.ingest(folder.path(), &["--out", text(&remote), "gs://bucket/drives"]);
    assert_eq!(said.code, 0, "{}", said.err);
    same_trees(&local, &remote);
}

#[test]
fn a_remote_log_is_inspected_and_errors_name_its_url() {
    let Some(mut store) = Store::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let logs = folder.path().join("logs");
    fs::create_dir(&logs).unwrap();
    DriveLog { seconds: 1.0, ..DriveLog::default() }.write(&logs, "drive.mcap");
    fs::write(logs.join("broken.mcap"), b"no log").unwrap();
    store.tell(json!(["upload", text(&logs), "drives"]));
    let ask = |url: &str| store.ingest(folder.path(), &["inspect", url]);
    let said = ask("s3://bucket/drives/drive.mcap");
    assert!(said.code == 0 && said.out.contains("camera"), "{}", said.err);
    let said = ask("s3://bucket/drives/broken.mcap");
    let expected = "error: this is not an MCAP file: its first bytes are not the MCAP magic (byte 0) \
                    in s3://bucket/drives/broken.mcap\n";
    assert!(said.code == 1 && said.err.starts_with(expected), "{}", said.err);
    let said = ask("s3://bucket/drives");
    assert!(said.code == 1 && said.err.contains("there are 2 logs below"), "{}", said.err);
    let out = folder.path().join("data");
    let ingest = |logs: &str| store.ingest(folder.path(), &["--out", text(&out), logs]);
    let said = ingest("s3://bucket/drives/broken.mcap");
    assert!(said.code == 1 && said.err.starts_with(expected), "{}", said.err);
    assert!(!out.exists());
}

#[test]
fn what_a_store_refuses_is_told_soon_with_its_url_and_what_to_do() {
    let Some(mut store) = Store::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("data");
    let log = DriveLog { seconds: 1.0, ..DriveLog::default() }.write(folder.path(), "drive.mcap");
    let closed = {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        format!("http://{}", listener.local_addr().unwrap())
    };
    let open = store.endpoint.clone();
    let check = |endpoint: &str, arguments: &[&str], error: &str, hint: &str| {
        let begun = Instant::now();
        let said = ingest_at(endpoint, folder.path(), arguments);
        println!("{:.1} s: {}", begun.elapsed().as_secs_f64(), said.err);
        assert_eq!(said.code, 1, "{}", said.err);
        assert!(said.err.starts_with(&format!("error: {error}")), "{}", said.err);
        let (_, hinted) = said.err.split_once("\n\nhint: ").unwrap();
        assert!(hinted.contains(hint), "{hinted}");
        assert!(begun.elapsed() < Duration::from_secs(30));
        assert!(!out.exists());
    };
    let from = |url: &'static str| ["--out", text(&out), url].map(String::from);
    let ask = |endpoint: &str, url: &'static str, error: &str, hint: &str| {
        check(endpoint, &from(url).iter().map(String::as_str).collect::<Vec<_>>(), error, hint);
    };
    ask(
        &open,
        "s3://nobodys/drives",
        "cannot list s3://nobodys/drives: NoSuchBucket: ",
        "spelt right",
    );
    ask(
        &open,
        "s3://bucket/none",
        "cannot find s3://bucket/none: there is no such object",
        "prefix",
    );
    let refused = "cannot find s3://bucket/drives: Connection refused";
    ask(&closed, "s3://bucket/drives", refused, "AWS_ENDPOINT_URL");
    ask(
        &open,
        "ftp://bucket/drives",
        "cannot open ftp://bucket/drives: ftp:// is no object",
        "gs://",
    );
    ask(&open, "s3://bucket/a//b", "cannot name s3://bucket/a//b: ", "empty parts");
    let to = ["--out", "s3://nobodys/data", text(&log)];
    check(&open, &to, "cannot list s3://nobodys/data: NoSuchBucket: ", "spelt right");
    store.tell(json!(["lock"]));
    ask(
        &open,
        "s3://bucket/",
        "cannot list s3://bucket: InvalidAccessKeyId: ",
        "AWS_ACCESS_KEY_ID",
    );
}
