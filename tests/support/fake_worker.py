"""A worker of the service that computes nothing: what a scan is called says what happens.

`ok.ply` and `refused.ply` are answered at once, `slow.ply` never, `crash.ply` ends the process,
`bad.ply` is bad input. The answers are files: `ok.json` and `refused.json` beside `--answers`.
"""

import json
import os
import sys
import time
from pathlib import Path


def main() -> None:
    answers = Path(sys.argv[1])
    send(event="ready", models={"scene.onnx": "0" * 64})
    for line in sys.stdin:
        job = json.loads(line)
        name = job.get("call", "")
        send(event="stage", stage="segmentation", seconds=0.25)
        if "slow" in name:
            time.sleep(600)
        if "crash" in name:
            os._exit(9)
        if "bad" in name:
            send(event="failed", status=422, code="bad_file", message="bad.ply: found nothing")
        elif job["kind"] == "build":
            Path(job["output"]).write_bytes((answers / "prior.npz").read_bytes())
            send(event="done", text="{}")
        elif job["kind"] == "report":
            Path(job["output"]).write_text("<html>report</html>")
            send(event="done", text="")
        else:
            kind = "refused" if "refused" in name else "ok"
            send(event="done", text=(answers / f"{kind}.json").read_text(), prior_bytes=5)


def send(**message: object) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
