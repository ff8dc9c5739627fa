"""The OPC UA server of the test plant: it publishes each interval, and takes writes that the panel allows."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asyncua import Server, ua
from asyncua.common.callback import CallbackType
from asyncua.common.utils import ServiceError

from adaptive_flot.contracts import PlantRecord
from adaptive_flot.errors import LinkError
from adaptive_flot.live.certificates import LINK, OPERATOR, PLANT, USERS, identity, password_file, read_password
from adaptive_flot.live.plant.operator import Operator
from adaptive_flot.live.plant.process import ProcessState, TestPlant
from adaptive_flot.live.plant.tags import (
    LINK_ASKS,
    LINK_HEARTBEAT,
    LINK_MODE,
    NAMESPACE,
    PLANT_ACTIVE,
    PLANT_HEARTBEAT,
    SWITCH,
    Tag,
    plant_tags,
)
from adaptive_flot.live.plant.users import Users

POLICIES = [ua.SecurityPolicyType[f"{name}_SignAndEncrypt"] for name in ("Aes256Sha256RsaPss", "Basic256Sha256")]
TYPES = {"number": ua.VariantType.Int64, "flag": ua.VariantType.Boolean, "text": ua.VariantType.String}
START = {"number": 0, "flag": False, "text": ""}
Distort = Callable[[Tag, ua.DataValue, int], ua.DataValue | None]
"""Changes what a tag shows in an interval (tests, benchmarks); None: the tag keeps what it showed."""


def as_told(tag: Tag, value: ua.DataValue, row: int) -> ua.DataValue | None:
    """The value as it is."""
    del tag, row
    return value


@dataclass(frozen=True)
class ServerPlace:
    """Where the server listens, and the folder of its certificate, key and passwords."""

    certificates: Path
    host: str = "127.0.0.1"
    port: int = 4840

    @property
    def url(self) -> str:
        """Address for clients."""
        return f"opc.tcp://{self.host}:{self.port}/adaptive-flot"


class PlantServer:
    """A test plant behind an OPC UA server.

    Parameters
    ----------
    plant
        The plant.
    place
        Where it listens.
    distort
        Changes what tags show.

    Attributes
    ----------
    state
        Plant and panel after the last interval.
    link_mode
        What the link last told of its mode.
    operator
        Turns the mode switch after each interval; None: nobody but a client does.
    """

    def __init__(self, plant: TestPlant, place: ServerPlace, distort: Distort = as_told) -> None:
        self.plant, self.place = plant, place
        self.state: ProcessState = plant.init()
        self.started = float(round(datetime.now(UTC).timestamp()))
        self.link_mode = ""
        self.operator: Operator | None = None
        self._distort = distort
        self._tags = {tag.name: tag for tag in plant_tags(plant.scenario)}
        self._by_id: dict[ua.NodeId, Tag] = {}
        self._ids: dict[str, ua.NodeId] = {}
        self._server: Server | None = None

    async def start(self) -> None:
        """Listen; LinkError where a file is missing or the port is in use."""
        me = identity(self.place.certificates, PLANT).checked()
        passwords = {user: read_password(password_file(self.place.certificates, user)) for user in USERS}
        trusted = [identity(self.place.certificates, name).checked().certificate for name in (LINK, OPERATOR)]
        server = Server(user_manager=Users(passwords, trusted))
        await server.init()
        server.set_endpoint(self.place.url)
        server.set_server_name("adaptive-flot test plant")
        await server.set_application_uri(me.uri)
        await server.load_certificate(me.certificate)
        await server.load_private_key(me.key)
        server.set_security_policy(POLICIES)
        server.set_identity_tokens([ua.UserNameIdentityToken])
        server.iserver.callback_service.addListener(CallbackType.PreWrite, self._before_write)
        await self._add_tags(server)
        try:
            await server.start()
        except OSError as error:
            raise LinkError(f"{self.place.url}: can not listen there ({error.strerror or error})") from error
        self._server = server
        await self._publish_panel()

    async def stop(self) -> None:
        """Stop listening."""
        if self._server is not None:
            await self._server.stop()
            self._server = None

    async def interval(self) -> PlantRecord:
        """One sampling interval of the plant, published; the heartbeat comes last."""
        self.state, record = self.plant.interval(self.state)
        if self.operator is not None:
            self.operator, switch = self.operator.next(self.link_mode)
            panel, _ = self.plant.panel.operated(self.state.panel, "switch", switch)
            self.state = replace(self.state, panel=panel)
        sample = record.sample
        model = self.plant.scenario.model
        for j, q in enumerate(model.inputs):
            await self._publish(q.name, float(sample.inputs[j]), sample.time)
        lost = {words.split(" ", 1)[1] for words in record.faults if words.startswith("missing ")}
        for j, q in enumerate(model.outputs):
            value = float(sample.outputs[j])
            if q.name in self._tags and math.isfinite(value):
                await self._publish(q.name, value, sample.time)
            elif q.name in lost:
                await self._publish(q.name, math.nan, sample.time)
        for late in sample.delayed:
            await self._publish(late.output, late.value, late.time)
        if sample.parameters is not None:
            for i in self.plant.scenario.measured_parameters:
                await self._publish(f"parameter.{model.parameters[i].name}", float(sample.parameters[i]), sample.time)
        await self._publish_panel()
        await self._publish(PLANT_HEARTBEAT, self.state.row, sample.time)
        return record

    async def run(self, speed: float) -> None:
        """Play the scenario, so many times faster than real time, until it is over."""
        loop = asyncio.get_running_loop()
        begin = loop.time()
        for k in range(self.plant.rows):
            await self.interval()
            due = begin + (k + 1) * self.plant.scenario.dt / speed
            await asyncio.sleep(max(0.0, due - loop.time()))

    def time_of(self, seconds: float) -> datetime:
        """Date of a time of the scenario [s]."""
        return datetime.fromtimestamp(self.started + seconds, UTC)

    async def _add_tags(self, server: Server) -> None:
        index = await server.register_namespace(NAMESPACE)
        folder = await server.nodes.objects.add_object(ua.NodeId("plant", index), f"{index}:plant")
        for tag in self._tags.values():
            node_id = ua.NodeId(tag.name, index)
            kind = TYPES.get(tag.kind, ua.VariantType.Double)
            start = ua.DataValue(
                ua.Variant(START.get(tag.kind, math.nan), kind),
                ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData if kind is ua.VariantType.Double else 0),
            )
            node = await folder.add_variable(node_id, f"{index}:{tag.name}", ua.Variant(START.get(tag.kind, 0.0), kind))
            await server.write_attribute_value(node.nodeid, start)
            if tag.writer:
                await node.set_writable()
            if kind is ua.VariantType.Double:
                low, high = (float(v) if math.isfinite(v) else math.copysign(1e30, v) for v in (tag.low, tag.high))
                unit = ua.EUInformation(DisplayName=ua.LocalizedText(tag.unit), Description=ua.LocalizedText(tag.unit))
                await node.add_property(index, "EURange", ua.Range(Low=low, High=high))
                await node.add_property(index, "EngineeringUnits", unit)
            self._by_id[node.nodeid], self._ids[tag.name] = tag, node.nodeid

    async def _publish(self, name: str, value: float | bool | str, time: float) -> None:
        tag = self._tags[name]
        kind = TYPES.get(tag.kind, ua.VariantType.Double)
        bad = isinstance(value, float) and not math.isfinite(value)
        told = ua.DataValue(
            ua.Variant(0.0 if bad else value, kind),
            ua.StatusCode(ua.StatusCodes.BadNoCommunication if bad else ua.StatusCodes.Good),
            SourceTimestamp=self.time_of(time),
        )
        shown = self._distort(tag, told, self.state.row)
        if shown is not None and self._server is not None:
            await self._server.write_attribute_value(self._ids[name], shown)

    async def _publish_panel(self) -> None:
        panel, now = self.state.panel, self.state.row * self.plant.scenario.dt
        for name in self.plant.limits:
            low, high = panel.limits[name]
            parts: Mapping[str, float] = {"acting": panel.acting[name], "low": low, "high": high}
            for part, value in {**parts, "local": panel.local[name]}.items():
                await self._publish(f"{name}.{part}", value, now)
        await self._publish(PLANT_ACTIVE, panel.active, now)
        await self._publish(SWITCH, int(panel.switch), now)

    async def _before_write(self, event: Any, service: Any) -> None:
        """Every write of a client, before it is carried out: all values of a request are taken, or none."""
        del service
        if not event.is_external:
            return
        panel = self.state.panel
        remote: dict[str, float] = {}
        for item in event.request_params.NodesToWrite:
            tag = self._by_id.get(item.NodeId)
            if (
                tag is None
                or item.AttributeId != ua.AttributeIds.Value
                or not tag.writer
                or tag.writer != event.user.name
            ):
                raise ServiceError(ua.StatusCodes.BadUserAccessDenied)
            if item.Value is not None and item.Value.StatusCode is not None and not item.Value.StatusCode.is_good():
                raise ServiceError(ua.StatusCodes.BadWriteNotSupported)
            value = item.Value.Value.Value if item.Value is not None and item.Value.Value is not None else None
            kind = TYPES.get(tag.kind, ua.VariantType.Double)
            if value is None or item.Value.Value.VariantType is not kind or isinstance(value, list):
                raise ServiceError(ua.StatusCodes.BadTypeMismatch)
            if tag.kind == "remote":
                remote[tag.of] = float(value)
            elif tag.name == LINK_HEARTBEAT:
                panel = self.plant.panel.beat(panel, int(value))
            elif tag.name == LINK_ASKS:
                panel = self.plant.panel.asked(panel, bool(value))
            elif tag.name == LINK_MODE:
                self.link_mode = str(value)
            else:
                panel, why = self.plant.panel.operated(panel, tag.name.removeprefix("plant."), float(value))
                if why:
                    raise ServiceError(ua.StatusCodes.BadOutOfRange)
        if remote:
            panel, why = self.plant.panel.remote(panel, remote)
            if why:
                self.state = replace(self.state, panel=replace(self.state.panel, refused=panel.refused))
                raise ServiceError(ua.StatusCodes.BadOutOfRange)
        self.state = replace(self.state, panel=panel)
