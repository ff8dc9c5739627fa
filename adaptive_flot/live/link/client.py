"""The OPC UA client of the link: reads by subscription, writes and reads back, and never waits without end.

After a loss a new client is made: one that is used again may keep waiting for answers of the connection before.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
from collections.abc import Awaitable, Mapping
from typing import Any, TypeVar

from asyncua import Client, ua
from asyncua.crypto import security_policies

from adaptive_flot.errors import LinkError
from adaptive_flot.live.certificates import LINK, Identity, read_password
from adaptive_flot.live.link.told import Point, Told
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.link_keys import Scale
from adaptive_flot.live.outcome import Written
from adaptive_flot.live.snapshot import Snapshot

T = TypeVar("T")
LOST = (OSError, asyncio.TimeoutError, ua.UaError, ConnectionError)
"""What a broken or hung connection raises."""
SAME = 1e-9
"""Relative difference up to which a value that is read back is the one that was written."""


def no_connection(url: str, error: Exception) -> str:
    """Why there is no connection to a server, and what to do about it, in words."""
    if isinstance(error, ConnectionRefusedError) or "Connect call failed" in str(error):  # of one address, of several
        why = "nothing listens there"
    elif isinstance(error, TimeoutError):
        why = "it does not answer"
    elif isinstance(error, socket.gaierror):
        why = "no such host"
    else:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
    return f"no connection to {url}: {why}; start the plant's server, or correct server.url in the link file"


class PlantClient:
    """One connection to the plant's server.

    Parameters
    ----------
    link
        The link file and its scenario.
    within_s
        How long a request may take [s of this machine].
    """

    def __init__(self, link: Link, within_s: float) -> None:
        self._link, self._within = link, within_s
        self._client: Client | None = None
        self._told = Told(link, {})
        self._names: dict[ua.NodeId, str] = {}

    async def connect(self) -> None:
        """Connect, log in and subscribe; one of `LOST` where it fails, LinkError where a file or a tag is missing."""
        part = self._link.file.server
        beside = self._link.beside
        me = Identity(LINK, beside(part.certificate), beside(part.key)).checked()
        client = Client(part.url, timeout=part.timeout_s)
        client.application_uri = me.uri
        client.set_user(part.user)
        client.set_password(read_password(beside(part.password_file)))
        policy = getattr(security_policies, f"SecurityPolicy{part.security}")
        await client.set_security(
            policy, me.certificate, me.key, server_certificate=str(beside(part.server_certificate))
        )
        try:
            await asyncio.wait_for(client.connect(), 2 * part.timeout_s)
            self._client = client
            await asyncio.wait_for(self._subscribe(client), 2 * part.timeout_s)
        except BaseException:
            await self.close()
            raise

    async def close(self) -> None:
        """Leave; a server that does not answer is left without a word."""
        client, self._client = self._client, None
        if client is None:
            return
        with contextlib.suppress(*LOST):
            await asyncio.wait_for(client.disconnect(), 1.0)
        with contextlib.suppress(Exception):
            client.disconnect_socket()

    async def new_sample(self, within_s: float) -> bool:
        """Wait for the plant's next heartbeat, so long at most [s of this machine]."""
        try:
            await asyncio.wait_for(self._told.fresh.wait(), within_s)
        except TimeoutError:
            return False
        self._told.fresh.clear()
        return True

    def snapshot(self, alive: bool, in_time: bool, written: bool) -> Snapshot:
        """What the plant has told by now."""
        return self._told.snapshot(alive, in_time, written)

    async def tell(self, heartbeat: int, asks: bool, mode: str) -> None:
        """The link's heartbeat, whether it asks for control, and its mode in words; one of `LOST` where it fails."""
        part = self._link.file.handshake
        values: list[tuple[str, ua.Variant]] = [
            (part.link_heartbeat, ua.Variant(heartbeat, ua.VariantType.Int64)),
            (part.asks, ua.Variant(asks, ua.VariantType.Boolean)),
        ]
        if part.mode is not None:
            values.append((part.mode, ua.Variant(mode, ua.VariantType.String)))
        await self._write([(self._node(tag), variant) for tag, variant in values])

    async def write(self, values: Mapping[str, float]) -> dict[str, Written]:
        """Write set-points and read each back; problems are in what is returned, none is raised."""
        asked = {}
        for name, value in values.items():
            part = self._link.file.writes[name]
            asked[name] = (self._node(part.tag), self._scale(name).tag(value))
        try:
            await self._write([(node, ua.Variant(v, ua.VariantType.Double)) for node, v in asked.values()])
            read = await self._within_time(
                self._open().read_values([self._open().get_node(n) for n, _ in asked.values()])
            )
        except (*LOST, LinkError) as error:
            problem = f"{type(error).__name__}: {error}"[:200]
            return {name: Written(value, math.nan, problem) for name, value in values.items()}
        found = {}
        for (name, (_, sent)), back in zip(asked.items(), read, strict=True):
            same = isinstance(back, float) and abs(back - sent) <= SAME * abs(sent)
            model = self._scale(name).model(back) if isinstance(back, float) else math.nan
            found[name] = Written(values[name], model, "" if same else f"read back {back!r}, written {sent!r}")
        return found

    def datachange_notification(self, node: Any, value: Any, data: Any) -> None:
        """A value has changed; called by asyncua."""
        del value
        self._told.take(self._names.get(node.nodeid), data.monitored_item.Value)

    async def _subscribe(self, client: Client) -> None:
        file = self._link.file
        index = await client.get_namespace_index(file.server.namespace) if file.server.namespace else 0
        self._index = index
        model = self._link.scenario.model
        units = {q.name: q.unit for q in (*model.inputs, *model.outputs)}
        units |= {f"parameter.{p.name}": p.unit for p in model.parameters}
        points = {n: Point(self._node(t.tag), Scale.of(t.unit, units[n]), t.delay_s) for n, t in file.tags.items()}
        for name, write in file.writes.items():
            scale = self._scale(name)
            points[f"acting {name}"] = Point(self._node(write.read_back), scale)
            for side, tag in (("low", write.operator_low), ("high", write.operator_high)):
                if tag is not None:
                    points[f"{side} {name}"] = Point(self._node(tag), scale)
        for key in ("active", "switch", "plant_heartbeat"):
            points[key] = Point(self._node(getattr(file.handshake, key)))
        self._told = Told(self._link, points)
        self._names = {point.node: name for name, point in points.items()}
        if len(self._names) < len(points):
            raise LinkError(f"{self._link.path}: two quantities have the same tag; give each its own")
        nodes = [client.get_node(point.node) for point in points.values()]
        for name, read in zip(
            points, await client.uaclient.read_attributes([n.nodeid for n in nodes], ua.AttributeIds.Value), strict=True
        ):
            if read.StatusCode is not None and read.StatusCode.value == ua.StatusCodes.BadNodeIdUnknown:
                raise LinkError(
                    f"{self._link.path}: {name}: the server has no node {points[name].node}; correct the tag"
                )
            if name != "plant_heartbeat":
                self._told.take(name, read)
        interval = 1000 * self._link.scenario.dt / self._link.file.cycle.speed
        subscription = await client.create_subscription(min(max(interval / 10, 5.0), 500.0), self)
        each = ua.DataChangeFilter(ua.DataChangeTrigger.StatusValueTimestamp, ua.DeadbandType.None_, 0.0)
        await self._monitor(subscription, nodes, each)

    @staticmethod
    async def _monitor(subscription: Any, nodes: list[Any], each: ua.DataChangeFilter) -> None:
        """Every new source time counts, also of a value that stays the same: else nothing could be told from stale."""
        made = await subscription._subscribe(
            nodes, ua.AttributeIds.Value, each, queuesize=1, monitoring=ua.MonitoringMode.Reporting
        )
        for result in made:
            if isinstance(result, ua.StatusCode):
                result.check()

    def _node(self, tag: str) -> ua.NodeId:
        return ua.NodeId.from_string(tag) if "=" in tag else ua.NodeId(tag, self._index)

    def _scale(self, moved: str) -> Scale:
        model = self._link.scenario.model
        return Scale.of(self._link.file.writes[moved].unit, model.inputs[model.index("inputs", moved)].unit)

    def _open(self) -> Client:
        if self._client is None:
            raise ConnectionError("not connected")
        return self._client

    async def _within_time(self, request: Awaitable[T]) -> T:
        return await asyncio.wait_for(request, self._within)

    async def _write(self, values: list[tuple[ua.NodeId, ua.Variant]]) -> None:
        client = self._open()
        nodes, told = [n for n, _ in values], [ua.DataValue(v) for _, v in values]
        results = await self._within_time(client.uaclient.write_attributes(nodes, told, ua.AttributeIds.Value))
        for result in results:
            result.check()
