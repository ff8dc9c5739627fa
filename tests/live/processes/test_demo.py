"""`make live-demo`: one command starts plant, link and page, and says where; ending it ends all of them."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import psutil

from tests.live.processes.test_kill import wait_for
from tests.live.processes.test_server import free_port

PATIENCE_S = 180


def test_one_command_starts_plant_link_and_page(tmp_path: Path) -> None:
    # a shell that starts the tests in the background lets them ignore Ctrl-C, and with them all that they start
    heeded = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    start = f"from adaptive_flot.live.demo import main; main(Path('demo'), {free_port()}, 0)"
    code = f"{heeded}; from pathlib import Path; {start}"
    demo = subprocess.Popen(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(Path.cwd())!r}); {code}"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
    )
    said: list[str] = []
    children: list[psutil.Process] = []
    assert demo.stdout is not None
    reading = threading.Thread(target=lambda out=demo.stdout: said.extend(iter(out.readline, "")))
    reading.start()
    try:
        wait_for(lambda: "Page: http://127.0.0.1:" in "".join(said), PATIENCE_S)
        wait_for(lambda: "all is well again" in "".join(said), PATIENCE_S)  # samples come from the plant
        address = re.findall(r"Page: (\S+)", "".join(said))[0]
        assert b"Log in" in urllib.request.urlopen(address, timeout=20).read()
        token = re.findall(r"Token for acting: (\S+)", "".join(said))[0]
        assert token == (tmp_path / "demo" / "certificates" / "act.token").read_text().strip()
        children = psutil.Process(demo.pid).children(recursive=True)
        assert children, "the plant"
        demo.send_signal(signal.SIGINT)
        assert demo.wait(PATIENCE_S) == 0
    finally:
        if demo.poll() is None:  # what it started holds its output open, and would let the reading wait for ever
            for process in [*psutil.Process(demo.pid).children(recursive=True), psutil.Process(demo.pid)]:
                process.kill()
        reading.join()
        demo.stdout.close()
    assert not psutil.wait_procs(children, PATIENCE_S)[1], "nothing outlives the command"
    assert "control is with the plant" in "".join(said)
