"""The link and the test plant over OPC UA on this machine: security, hand-over, faults of the network."""

from __future__ import annotations

import asyncio
import itertools
import logging
import shutil
import socket
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, TypeVar

import pytest
from asyncua import Client, ua
from asyncua.crypto import security_policies

from adaptive_flot.errors import LinkError, OutputError
from adaptive_flot.live.certificates import identity, make_certificates, password_file, read_password
from adaptive_flot.live.link.client import LOST, no_connection
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.plant.server import PlantServer, ServerPlace
from adaptive_flot.live.plant.tags import NAMESPACE
from adaptive_flot.live.running.run import LinkRun
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario

logging.getLogger("asyncua").setLevel(logging.CRITICAL)
BASIC, AES = security_policies.SecurityPolicyBasic256Sha256, security_policies.SecurityPolicyAes256Sha256RsaPss
SPEED = 10.0
T = TypeVar("T")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Served:
    """A server in a thread of its own, which several tests share: it takes seconds to start."""

    def __init__(self, server: PlantServer) -> None:
        self.server = server
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.run(server.start())

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Run something beside the server."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(60)

    def close(self) -> None:
        self.run(self.server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


@pytest.fixture(scope="module")
def shared(scenario: Scenario, certificates: Path) -> Iterator[Served]:
    served = Served(PlantServer(TestPlant(Realisation(scenario, 1)), ServerPlace(certificates, port=free_port())))
    yield served
    served.close()


@pytest.fixture
def served(shared: Served) -> Served:
    """The shared server with its plant at the start."""
    shared.server.state = shared.server.plant.init()
    return shared


@asynccontextmanager
async def client(
    server: PlantServer,
    name: str = "link",
    policy: Any = AES,
    *,
    folder: Path | None = None,
    password: str | None = None,
) -> AsyncIterator[Client]:
    """A session of a user of this test plant, with the certificate of a folder."""
    own = server.place.certificates
    me = identity(folder or own, name)
    made = Client(server.place.url, timeout=3)
    made.application_uri = me.uri
    made.set_user(name)
    made.set_password(password or read_password(password_file(own, name)))
    await made.set_security(policy, me.certificate, me.key, server_certificate=str(identity(own, "plant").certificate))
    async with made:
        yield made


async def write(session: Client, tag: str, value: object, kind: ua.VariantType = ua.VariantType.Double) -> None:
    index = await session.get_namespace_index(NAMESPACE)
    await session.get_node(ua.NodeId(tag, index)).write_value(ua.DataValue(ua.Variant(value, kind)))


async def refused(request: Awaitable[object]) -> bool:
    try:
        await request
    except ua.UaStatusCodeError:
        return True
    return False


@pytest.mark.parametrize("policy", [AES, BASIC])
def test_tags_carry_units_ranges_source_times_and_status(served: Served, policy: Any) -> None:
    async def run() -> None:
        server = served.server
        async with client(server, policy=policy) as session:
            index = await session.get_namespace_index(NAMESPACE)
            node = session.get_node(ua.NodeId("air_flow", index))
            await server.interval()
            told = await node.read_data_value()
            assert told.StatusCode.is_good() and told.Value.Value == 1.4e-3
            assert told.SourceTimestamp.timestamp() == server.started + 1
            properties = {p.Name: p for p in [await c.read_browse_name() for c in await node.get_children()]}
            assert set(properties) == {"EURange", "EngineeringUnits"}
            unit = await node.get_child(f"{index}:EngineeringUnits")
            assert (await unit.read_value()).DisplayName.Text == "m3/s"

    served.run(run())


def test_each_user_writes_his_own_tags_and_nobody_else_anything(served: Served) -> None:
    async def run() -> None:
        server = served.server
        await server.interval()
        before = server.state
        async with client(server, "link") as link:
            number = ua.VariantType.Int64
            assert await refused(write(link, "plant.switch", 3, number))
            assert await refused(write(link, "air_flow.low", 1e-3))
            assert await refused(write(link, "concentrate_grade", 0.5))
            assert await refused(write(link, "plant.active", True, ua.VariantType.Boolean))
            assert await refused(write(link, "air_flow.remote", 1.41e-3)), "it has no control"
            assert await refused(write(link, "link.heartbeat", "x", ua.VariantType.String))
            assert await refused(write(link, "link.heartbeat", [1, 2], number))
        async with client(server, "operator") as operator:
            assert await refused(write(operator, "air_flow.remote", 1.41e-3))
            assert await refused(write(operator, "air_flow.high", 1.0)), "outside the plant's clamps"
            assert await refused(write(operator, "plant.switch", 7, number))
            assert server.state.panel.limits == before.panel.limits
            await write(operator, "plant.switch", 2, number)
        assert server.state.panel.switch is Mode.ADVISORY
        assert server.state.panel.acting == before.panel.acting

    served.run(run())


def test_who_is_not_known_does_not_get_in(served: Served, certificates: Path, tmp_path: Path) -> None:
    """No anonymous session, no open channel, no wrong password, no certificate that is not trusted."""
    make_certificates(tmp_path / "others")

    async def run() -> None:
        server = served.server
        with pytest.raises((ua.UaError, *LOST)):
            async with Client(server.place.url, timeout=2):
                pass
        with pytest.raises((ua.UaError, *LOST)):
            async with client(server, password="wrong"):
                pass
        with pytest.raises((ua.UaError, *LOST)):
            async with client(server, folder=tmp_path / "others"):
                pass
        me = identity(certificates, "link")
        anonymous = Client(server.place.url, timeout=2)
        anonymous.application_uri = me.uri
        plant = str(identity(certificates, "plant").certificate)
        await anonymous.set_security(AES, me.certificate, me.key, server_certificate=plant)
        with pytest.raises((ua.UaError, *LOST)):
            async with anonymous:
                pass

    served.run(run())


def test_garbage_on_the_port_changes_nothing(served: Served) -> None:
    async def run() -> None:
        server = served.server
        for content in (
            b"GET / HTTP/1.1\r\n\r\n",
            b"HELF" + b"\xff" * 60,
            bytes(range(256)) * 40,
            b"OPNF\x10\0\0\0" * 9,
        ):
            reader, writer = await asyncio.open_connection("127.0.0.1", server.place.port)
            writer.write(content)
            writer.close()
            await asyncio.sleep(0)
            del reader
        async with client(server) as session:
            assert await session.get_namespace_index(NAMESPACE)

    served.run(run())


class Together:
    """A plant that plays, and a link that runs beside it."""

    def __init__(self, server: PlantServer, run: LinkRun) -> None:
        self.server, self.link = server, run
        self.modes: list[Mode] = []
        self.acting: list[dict[str, float]] = []

    async def until(self, condition: Callable[[], bool], seconds: float = 200.0) -> None:
        """Wait for something; the limit only ends a test that would wait for ever."""
        loop = asyncio.get_running_loop()
        end = loop.time() + seconds
        while not condition():
            assert loop.time() < end, f"waited in vain: mode {self.mode.name}"
            await asyncio.sleep(0.02)

    @property
    def mode(self) -> Mode:
        return self.link.state.modes.mode

    async def play(self) -> None:
        while True:
            await self.server.interval()
            self.acting.append(dict(self.server.state.panel.acting))
            await asyncio.sleep(1 / SPEED)


@asynccontextmanager
async def together(link: Link, certificates: Path) -> AsyncIterator[Together]:
    port = int(link.file.server.url.split(":")[2].split("/")[0])
    server = PlantServer(TestPlant(Realisation(link.scenario, 1)), ServerPlace(certificates, port=port))
    memory = Memory(open_database(link.file.database, link.path.parent), link)
    both = Together(server, LinkRun(link, memory))
    stop = asyncio.Event()
    await server.start()
    tasks = [asyncio.create_task(both.play()), asyncio.create_task(both.link.run(stop))]
    try:
        yield both
    finally:
        stop.set()
        try:
            await tasks[1]
        finally:
            tasks[0].cancel()
            await server.stop()
            memory.close()


def patient(write_link: Callable[..., Link], scenario: Scenario) -> Link:
    """A link that a loaded machine does not make shed for its slowness alone."""
    changes = {"controller": "pi", "cycle.deadline": 0.95, "cycle.shed_after": 10}
    return write_link(scenario, changes, port=free_port(), speed=SPEED)


def test_up_to_closed_and_the_operator_takes_it_back(
    write_link: Callable[..., Link], scenario: Scenario, certificates: Path
) -> None:
    async def run() -> None:
        async with together(patient(write_link, scenario), certificates) as both:
            await both.until(lambda: both.link.state.estimation.estimate is not None)
            async with client(both.server, "operator") as operator:
                await write(operator, "plant.switch", 3, ua.VariantType.Int64)
                await both.until(lambda: both.mode is Mode.CLOSED and both.server.state.panel.active)
                before = both.server.state.panel.acting["air_flow"]
                await both.until(lambda: both.server.state.panel.acting["air_flow"] != before)
                await write(operator, "plant.switch", 1, ua.VariantType.Int64)
            assert not both.server.state.panel.active, "the plant does not wait for the link"
            await both.until(lambda: both.mode is Mode.MONITOR)
            check_moves(both)

    asyncio.run(run())


def check_moves(both: Together) -> None:
    for name, limit in both.server.plant.limits.items():
        values = [a[name] for a in both.acting]
        assert max(abs(b - a) for a, b in itertools.pairwise(values)) <= limit.rate * (1 + 1e-6)


def test_a_server_that_stops_and_comes_back(
    write_link: Callable[..., Link], scenario: Scenario, certificates: Path
) -> None:
    """The link sheds, connects again by itself, and waits for the operator."""

    async def run() -> None:
        async with together(patient(write_link, scenario), certificates) as both:
            await both.until(lambda: both.link.state.estimation.estimate is not None)
            both.server.state = operated(both.server, Mode.CLOSED)
            await both.until(lambda: both.mode is Mode.CLOSED)
            await both.server.stop()
            await both.until(lambda: both.mode is Mode.SHED)
            both.server.state = operated(both.server, Mode.CLOSED, active=False)
            await both.server.start()
            sample = both.link.state.sample
            await both.until(lambda: both.link.state.sample is not sample)
            assert both.mode is Mode.SHED
            both.server.state = operated(both.server, Mode.MONITOR)
            await both.until(lambda: both.mode is Mode.MONITOR)

    asyncio.run(run())


def operated(server: PlantServer, switch: Mode, active: bool | None = None) -> Any:
    from dataclasses import replace

    panel = replace(server.state.panel, switch=switch)
    return replace(server.state, panel=panel if active is None else replace(panel, active=active, asked=False))


def test_certificates_are_private_and_never_overwritten(tmp_path: Path) -> None:
    files = make_certificates(tmp_path / "c")
    secret = [f for f in files if f.suffix in (".pem", ".password")]
    assert len(secret) == 5 and all(f.stat().st_mode & 0o777 == 0o600 for f in secret)
    with pytest.raises(OutputError, match="is there already"):
        make_certificates(tmp_path / "c")


@pytest.mark.parametrize("host", ["bad host!!", "", "plant..example", "-plant", "10.0.0.5/24"])
def test_what_is_no_host_is_refused_before_a_file_is_written(tmp_path: Path, host: str) -> None:
    """A certificate for it would be good for nothing."""
    with pytest.raises(LinkError, match="no name or address of a host"):
        make_certificates(tmp_path / "c", (host,))
    assert not (tmp_path / "c").exists()


def test_why_there_is_no_connection_is_told() -> None:
    """The address in the link file may be wrong, or the server is not up: both are told from a server that is slow."""
    url = "opc.tcp://127.0.0.1:4840/plant"
    several = OSError("Multiple exceptions: [Errno 111] Connect call failed ('::1', 4840, 0, 0), [Errno 111] ...")
    for error in (ConnectionRefusedError(111, "Connect call failed ('127.0.0.1', 4840)"), several):
        assert no_connection(url, error).startswith(f"no connection to {url}: nothing listens there; start the plant")
    assert "does not answer" in no_connection(url, TimeoutError())
    assert "no such host" in no_connection(url, socket.gaierror(-2, "Name or service not known"))
    assert ": BadIdentityTokenRejected;" in no_connection(url, ValueError("BadIdentityTokenRejected\nmore"))


def test_a_plant_without_its_key_says_so(scenario: Scenario, certificates: Path, tmp_path: Path) -> None:
    shutil.copytree(certificates, tmp_path / "c")
    (tmp_path / "c" / "plant.pem").unlink()
    server = PlantServer(TestPlant(Realisation(scenario, 1)), ServerPlace(tmp_path / "c", port=free_port()))
    with pytest.raises(LinkError, match=r"plant\.pem: no such file; make it with `adaptive-flot certificates`"):
        asyncio.run(server.start())
