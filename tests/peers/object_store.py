"""An S3 server (moto) and a client of it (boto3), for tests/it/remote.rs.

It prints its port, then takes commands from stdin, a JSON array a line, and answers each with a line of JSON:

    ["upload", folder, prefix]      every file below a folder
    ["download", prefix, folder]    every object below a prefix
    ["list", prefix]                keys
    ["remove", prefix]              every object below a prefix
    ["requests"]                    methods and keys of the requests so far, which it then forgets
    ["hold", text]                  let PUT requests wait whose path has the text; "" lets them go
    ["lock"]                        from now on ask for credentials, which nobody has
"""

import json
import logging
import pathlib
import sys
import threading
import urllib.request

import boto3
from botocore.config import Config
from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import WSGIRequestHandler, make_server

BUCKET = "bucket"

requests = []
held = {"text": "", "waiting": 0}
changed = threading.Condition()


class Watched:
    """The server's application, watched."""

    def __init__(self, app):
        self.app = app

    def __call__(self, environ, start_response):
        path, method = environ["PATH_INFO"], environ["REQUEST_METHOD"]
        with changed:
            was_held = method == "PUT" and held["text"] and held["text"] in path
            if was_held:
                held["waiting"] += 1
                changed.wait_for(lambda: not held["text"] or held["text"] not in path)
            if path.startswith(f"/{BUCKET}/"):
                requests.append([method, path.removeprefix(f"/{BUCKET}/")])
        try:
            return self.app(environ, start_response)
        finally:
            if was_held:
                with changed:
                    held["waiting"] -= 1
                    changed.notify_all()


class Quiet(WSGIRequestHandler):
    def log(self, *_):
        pass


def main():
    logging.disable(logging.CRITICAL)
    app = Watched(DomainDispatcherApplication(create_backend_app))
    server = make_server("127.0.0.1", 0, app, threaded=True, request_handler=Quiet)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    endpoint = f"http://127.0.0.1:{server.server_port}"
    settings = dict(region_name="us-east-1", aws_access_key_id="test", aws_secret_access_key="test")
    path_style = Config(s3={"addressing_style": "path"})
    s3 = boto3.client("s3", endpoint_url=endpoint, config=path_style, **settings)
    s3.create_bucket(Bucket=BUCKET)
    requests.clear()
    print(server.server_port, flush=True)

    def keys(prefix):
        pages = s3.get_paginator("list_objects_v2").paginate(Bucket=BUCKET, Prefix=prefix)
        return [found["Key"] for page in pages for found in page.get("Contents", [])]

    for line in sys.stdin:
        answer = None
        match json.loads(line):
            case ["upload", folder, prefix]:
                for file in sorted(p for p in pathlib.Path(folder).rglob("*") if p.is_file()):
                    s3.upload_file(str(file), BUCKET, f"{prefix}/{file.relative_to(folder)}", ExtraArgs={"ACL": "public-read"})
            case ["download", prefix, folder]:
                for key in keys(prefix + "/"):
                    file = pathlib.Path(folder) / key.removeprefix(prefix + "/")
                    file.parent.mkdir(parents=True, exist_ok=True)
                    s3.download_file(BUCKET, key, str(file))
            case ["list", prefix]:
                answer = keys(prefix)
            case ["remove", prefix]:
                for key in keys(prefix):
                    s3.delete_object(Bucket=BUCKET, Key=key)
            case ["requests"]:
                with changed:
                    answer, requests[:] = list(requests), []
            case ["hold", text]:
                with changed:
                    held["text"] = text
                    changed.notify_all()
                    # Those that were let go are through, whoever sent them may be dead.
                    changed.wait_for(lambda: text or held["waiting"] == 0, timeout=30)
            case ["lock"]:
                reset = urllib.request.Request(f"{endpoint}/moto-api/reset-auth", data=b"0", headers={"Content-Type": "text/plain"})
                urllib.request.urlopen(reset).read()
        print(json.dumps(answer), flush=True)


main()
