"""OPC UA: what a client with the right certificate, name and password sees, and what everybody else does not."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from datetime import timedelta
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import Client, ua  # noqa: E402
from asyncua.crypto.security_policies import (  # noqa: E402
    SecurityPolicyAes128Sha256RsaOaep,
    SecurityPolicyAes256Sha256RsaPss,
)

from gantryctl.gateway.opcua.server import POLICIES  # noqa: E402
from gantryctl.service.protocol.tags import TAGS  # noqa: E402
from gantryctl.service.supervisor.users import Users  # noqa: E402
from support.opcua_bench import PASSWORD, Bench, Run  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself


SHOWN = {"axis_state": "continuous_motion", "pos_act_deg": 12.5, "power": True, "scan": 7, "machine": "m",
         "alarms": [{"first_out": False, "code": "DRV-02", "text": "DRV-02 STOP"},
                    {"first_out": True, "code": "CTL-03", "text": "CTL-03 STOP"}]}  # fmt: skip


def test_a_trusted_client_reads_the_axis_and_can_change_nothing(run: Run) -> None:
    async def check(bench: Bench) -> None:
        await bench.space.show(SHOWN, age_ms=0.0)
        async with await bench.client() as client:
            space = await client.get_namespace_index("urn:gantryctl:axis")

            async def value(name: str) -> Any:
                return await client.get_node(ua.NodeId(name, space)).read_value()

            assert await value("ReadActualPosition.Position") == 12.5
            assert [await value(f"Axis.{name}") for name in ("ContinuousMotion", "Standstill")] == [
                True,
                False,
            ]
            # The one that stopped the axis; a later one, which it has brought about, stands above it in the list.
            assert await value("Axis.AxisErrorID") == "CTL-03"
            assert await value("Axis.Text") == "CTL-03 STOP"
            assert [await value(f"Tags.{name}") for name in ("power", "scan", "machine")] == [True, 7, "m"]
            assert [row["code"] for row in json.loads(await value("Tags.alarms"))] == ["DRV-02", "CTL-03"]
            tags = await client.nodes.objects.get_child([f"{space}:Axis", f"{space}:Tags"])
            assert {(await node.read_browse_name()).Name for node in await tags.get_children()} == {
                tag.name for tag in TAGS
            }
            node = client.get_node(ua.NodeId("Tags.pos_act_deg", space))
            for change in (
                node.write_value(1.0),
                client.nodes.objects.add_variable(space, "mine", 1),
                client.nodes.server.call_method("0:GetMonitoredItems", 1),
                node.delete(),
            ):
                with pytest.raises(ua.UaError):
                    await change
            assert await value("Tags.pos_act_deg") == 12.5

    run(check)


def test_a_value_is_dated_when_it_was_read_and_not_when_it_was_written(run: Run) -> None:
    async def check(bench: Bench) -> None:
        async with await bench.client() as client:
            space = await client.get_namespace_index("urn:gantryctl:axis")
            node = client.get_node(ua.NodeId("Tags.pos_act_deg", space))
            dates = []
            # Written a moment later, and a minute old.
            for shown, age_ms in ((1.0, 0.0), (2.0, 60_000.0)):
                await bench.space.show({**SHOWN, "pos_act_deg": shown}, age_ms=age_ms)
                found = await node.read_data_value(raise_on_bad_status=False)
                dates.append(found.SourceTimestamp)
            # A minute before the time at which it was written, which is later than the first.
            assert timedelta(seconds=0) < dates[0] - dates[1] <= timedelta(seconds=60)

    run(check)


def test_nobody_else_gets_in(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wrong: tuple[dict[str, str], ...] = (
            {"key": ""},  # no security
            {"key": "", "user": ""},
            {"user": ""},  # anonymous
            {"user": "admin", "password": ""},
            {"password": "wrong wrong wrong"},
            {"key": "stranger"},  # a certificate that is not trusted
        )
        for how in wrong:
            client = await bench.client(**how)
            with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError, OSError)):
                await client.connect()
        async with await bench.client():
            pass

    run(check)


def test_wrong_passwords_are_in_the_journal(run: Run) -> None:
    async def check(bench: Bench) -> None:
        for _ in range(2):
            client = await bench.client(password="wrong wrong wrong")
            with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError, OSError)):
                await client.connect()
        assert bench.texts() == [f"refused: wrong name or password, {n} times" for n in (1, 2)]

    run(check)


@pytest.mark.parametrize("change", ["password", "damaged"])
def test_a_session_ends_when_its_user_is_not_the_same_any_more(run: Run, change: str) -> None:
    async def check(bench: Bench) -> None:
        users = Users(bench.root)
        before = users.path.read_bytes()
        client = await bench.client("other")
        await client.connect()
        await bench.listener.sweep()
        assert await client.nodes.server_state.read_value() is not None  # nothing has changed yet
        if change == "password":
            users.set_password("other", PASSWORD + "!")
        else:
            users.path.write_text("{", encoding="utf-8")
        await bench.listener.sweep()
        with pytest.raises((ua.UaError, ConnectionError, asyncio.TimeoutError, OSError)):
            await client.nodes.server_state.read_value()
        assert bench.texts() == ["OPC UA session", "OPC UA session ended: the user has changed"]
        with suppress(ua.UaError, ConnectionError, asyncio.TimeoutError, OSError):
            await client.disconnect()
        users.path.write_bytes(before)

    run(check)


def test_only_policies_that_sign_and_encrypt_are_offered(run: Run) -> None:
    async def check(bench: Bench) -> None:
        offered = await Client(bench.address).connect_and_get_server_endpoints()
        assert len(offered) == len(POLICIES)
        for endpoint in offered:
            assert endpoint.SecurityMode == ua.MessageSecurityMode.SignAndEncrypt
            assert [token.TokenType for token in endpoint.UserIdentityTokens] == [ua.UserTokenType.UserName]
            # As its certificate says.
            assert endpoint.Server.ApplicationUri == "urn:gantryctl:server"
        assert (bench.root / "opcua" / "key.pem").stat().st_mode & 0o077 == 0

    run(check)


def test_the_status_of_a_value_follows_its_age(run: Run) -> None:
    async def check(bench: Bench) -> None:
        async with await bench.client() as client:
            node = client.get_node(ua.NodeId("ReadActualPosition.Position", 2))
            spent = client.get_node(ua.NodeId("Tags.estop_ok_2", 2))
            for age_ms, name in (
                (0.0, "Good"),
                (499.0, "Good"),
                (501.0, "UncertainNoCommunicationLastUsableValue"),
                (4999.0, "UncertainNoCommunicationLastUsableValue"),
                (5001.0, "BadNoCommunication"),
                (0.0, "Good"),
            ):
                await bench.space.show(SHOWN, age_ms)
                found = await node.read_data_value(raise_on_bad_status=False)
                assert found.StatusCode.name == name
                assert found.Value.Value == (None if name.startswith("Bad") else 12.5)
            # What is not believed, and what is not fitted, is no good value either.
            await bench.space.show({**SHOWN, "pos_act_deg": None}, 0.0)
            for each, name in ((node, "BadSensorFailure"), (spent, "BadOutOfService")):
                assert (await each.read_data_value(raise_on_bad_status=False)).StatusCode.name == name

    run(check)


def test_a_subscriber_with_a_deadband_is_told_that_a_value_has_gone_bad(run: Run) -> None:
    async def check(bench: Bench) -> None:
        told: list[str] = []

        class Listener:
            def datachange_notification(self, node: Any, value: Any, data: Any) -> None:
                told.append(data.monitored_item.Value.StatusCode.name)

        await bench.space.show(SHOWN, 0.0)
        async with await bench.client() as client:
            subscription = await client.create_subscription(200, Listener())
            node = client.get_node(ua.NodeId("ReadActualPosition.Position", 2))
            await subscription.deadband_monitor(node, 0.5)
            await bench.space.show(SHOWN, 6000.0)
            for _ in range(250):
                await asyncio.sleep(0.02)
                if told[-1:] == ["BadNoCommunication"]:
                    break
            assert told[-1] == "BadNoCommunication"

    run(check)


def test_every_analogue_tag_has_its_unit_and_range(run: Run) -> None:
    async def check(bench: Bench) -> None:
        limits = {"pos_min_deg": -95.0, "pos_max_deg": 180.0, "torque_max_nm": 385.0, "speed_max_deg_s": 6.0}
        await bench.space.show({**SHOWN, **limits}, 0.0)
        async with await bench.client("viewer", policy=SecurityPolicyAes256Sha256RsaPss) as client:
            ranges, units = {}, {}
            for tag in TAGS:
                node = client.get_node(ua.NodeId(f"Tags.{tag.name}", 2))
                names = {(await each.read_browse_name()).Name: each for each in await node.get_properties()}
                assert set(names) == ({"EURange", "EngineeringUnits"} if tag.kind == "float" else set()), tag
                if not names:
                    continue
                assert await node.read_type_definition() == ua.NodeId(ua.ObjectIds.AnalogItemType)
                ranges[tag.name] = await names["EURange"].read_value()
                units[tag.unit] = (await names["EngineeringUnits"].read_value()).UnitId
                assert ranges[tag.name].Low < ranges[tag.name].High
        # UNECE Recommendation 20 as the OPC Foundation numbers it: DD, E96, M45, NU, SEC, C26, B98, P1, C62.
        assert units == {
            "deg": 17476, "deg/s": 4536630, "deg/s2": 5059637, "N m": 20053, "s": 5457219, "ms": 4403766,
            "us": 4340024, "%": 20529, "": 4404786,
        }  # fmt: skip
        shown = {name: (ranges[name].Low, ranges[name].High) for name in ("pos_act_deg", "torque_act_nm")}
        assert shown == {"pos_act_deg": (-180.0, 180.0), "torque_act_nm": (-385.0, 385.0)}
        assert (ranges["override_percent"].Low, ranges["override_percent"].High) == (0.0, 100.0)

    run(check)


def test_all_offered_policies_work_with_the_library_s_client(run: Run) -> None:
    async def check(bench: Bench) -> None:
        for policy in (SecurityPolicyAes128Sha256RsaOaep, SecurityPolicyAes256Sha256RsaPss):
            async with await bench.client(policy=policy) as client:
                (node,) = await client.register_nodes([client.get_node(ua.NodeId("Tags.scan", 2))])
                assert await node.read_value() == 7
                await client.unregister_nodes([node])

    run(check)
