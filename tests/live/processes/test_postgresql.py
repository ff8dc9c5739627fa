"""The memory of the link in PostgreSQL: a server is started where the system has one, else the test is left out."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.errors import LinkError
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link.replay import replay
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.live.store.record import stretches
from tests.live.bench import Bench
from tests.live.processes.test_server import free_port

PLACES = os.pathsep.join([os.environ.get("PATH", ""), *map(str, Path("/usr/lib/postgresql").glob("*/bin"))])
SERVER, INIT = shutil.which("pg_ctl", path=PLACES), shutil.which("initdb", path=PLACES)


@pytest.fixture
def url() -> Iterator[str]:
    """URL of an empty database in a server of its own."""
    if SERVER is None or INIT is None:
        pytest.skip("no PostgreSQL on this system; `make postgresql` installs it where it may (Debian, as root)")
    # a short path below the system's own folder: sockets ask for it, and PostgreSQL, which refuses to run as root, may
    # not look into the folders of the tests, which belong to whoever runs them
    place = Path(tempfile.mkdtemp(prefix="flot-"))
    data, port = place / "data", free_port()
    user = "postgres" if os.geteuid() == 0 else None
    if user is not None:
        shutil.chown(place, user)
    subprocess.run([INIT, "-D", data, "-U", "tester", "-A", "trust"], check=True, capture_output=True, user=user)
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories='{data}'"
    start = [SERVER, "-D", str(data), "-l", str(data / "log"), "-w", "-o", options, "start"]
    subprocess.run(start, check=True, stdout=subprocess.DEVNULL, user=user)
    try:
        yield f"postgresql+psycopg://tester@127.0.0.1:{port}/postgres"
    finally:
        subprocess.run([SERVER, "-D", data, "-m", "immediate", "stop"], check=True, capture_output=True, user=user)
        shutil.rmtree(place)


def test_cycles_come_back_to_the_bit(url: str, cycle: Cycle, link: Link, tmp_path: Path) -> None:
    memory = Memory(open_database(url, tmp_path), link)
    bench = Bench(cycle, memory=memory)
    bench.to_closed()
    outcomes = bench.run(10)
    engine = open_database(url, tmp_path)
    assert replay(engine, link).different == 0
    (stretch,) = stretches(engine, link)
    assert outcomes[-1].sample is not None
    assert np.array_equal(stretch.samples[-1].outputs, outcomes[-1].sample.outputs, equal_nan=True)
    again = Memory(engine, link)
    assert again.session == 2 and again.resumed is not None
    memory.close()
    again.close()


def test_a_server_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"database: can not be used \(.*refused") as problem:
        open_database(f"postgresql+psycopg://tester@127.0.0.1:{free_port()}/nothing", tmp_path)
    assert "\n" not in str(problem.value)
