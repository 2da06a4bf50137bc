"""The service with real processes on loopback: what a person at the page, a script and a second person can do."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import ssl
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from gantryctl.gateway.access import COOKIE
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.trace.reader import read_trace
from support.service_process import PASSWORD, Page, Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
LEASE = "0123456789abcdef"


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    root = tmp_path_factory.mktemp("service")
    add_users(root)
    with Service(root) as made:
        yield made


@pytest.fixture(autouse=True)
def _at_rest(service: Service) -> Iterator[None]:
    yield
    with service.page("viewer") as page:
        page.do("stop")
        page.until(lambda tags: tags["at_rest"] and not tags["authority_user"])


def test_an_operator_moves_to_an_angle_and_the_journal_says_so(service: Service) -> None:
    with service.page("operator") as page:
        page.power_up()
        target = round(page.tags["pos_act_deg"] + 0.2, 3)
        page.do("set", tag="speed_setting_deg_s", value=0.6)
        page.do("move", target_deg=target)
        page.until(lambda tags: tags["in_position"] and tags["axis_state"] == "standstill")
        assert page.tags["pos_act_deg"] == pytest.approx(target, abs=0.005)  # the in-position window
        page.until(lambda tags: tags["journal_committed"] == tags["journal_sequence"])
    texts = [row.values["text"] for row in read_journal(service.directory)]
    assert f"move {target}: done" in texts
    assert verify(service.directory).wrong == ""


def test_hold_to_run_stops_when_released_and_when_the_lease_ends(service: Service) -> None:
    with service.page("operator") as page:
        page.power_up()
        page.do("jog", lease=LEASE, direction="reverse")
        page.until(lambda tags: tags["vel_act_deg_s"] < -0.05, renew=LEASE)
        assert page.tags["lease_left_ms"] > 0.0
        page.do("release", lease=LEASE)
        page.until(lambda tags: tags["at_rest"])
        other = LEASE[::-1]
        page.do("jog", lease=other, direction="forward")
        page.until(lambda tags: tags["vel_act_deg_s"] > 0.05, renew=other)
        page.until(lambda tags: tags["at_rest"])  # nobody renews any more
        assert page.tags["lease_left_ms"] == 0.0
        page.say("renew", lease=other)
        page.until(lambda _: bool(page.replies))
        assert page.replies.popitem()[1]["code"] == "SEC-09"
        assert page.refused("jog", lease=other, direction="forward") == "SEC-09"


def test_a_browser_that_is_gone_stops_its_jog_and_frees_control(service: Service) -> None:
    with service.page("viewer") as watcher:
        page = service.page("operator")
        page.power_up()
        page.do("jog", lease="f" * 16, direction="forward")
        page.until(lambda tags: tags["vel_act_deg_s"] > 0.05, renew="f" * 16)
        page.socket.socket.shutdown(socket.SHUT_RDWR)  # as when a browser is killed
        watcher.until(lambda tags: tags["at_rest"])
        watcher.until(lambda tags: tags["authority_user"] == "")


def test_what_is_of_the_past_is_refused(service: Service) -> None:
    with service.page("operator") as page:
        page.power_up()
        epoch = page.tags["epoch"]
        old = page.frame
        began_ms = page.tags["issued_ms"]
        page.until(lambda tags: tags["issued_ms"] - began_ms > 600)
        assert page.refused("move", target_deg=1.0, frame=old) == "SEC-02"
        issued_ms, seal = page.frame.split("-")
        assert page.refused("move", target_deg=1.0, frame=f"{int(issued_ms) + 1}-{seal}") == "SEC-02"
        page.do("stop")
        assert page.refused("move", target_deg=1.0, epoch=epoch) == "SEC-03"
        page.look()
        assert page.refused("move", target_deg=1.0, seq=1) == "SEC-04"


def test_two_operators_have_one_control_and_everyone_may_stop(service: Service) -> None:
    with (
        service.page("operator") as first,
        service.page("physicist") as second,
        service.page("viewer") as viewer,
    ):
        first.power_up()
        assert second.refused("take", over=False) == "SEC-07"
        assert second.refused("move", target_deg=1.0) == "SEC-07"
        first.do("set", tag="speed_setting_deg_s", value=3.0)
        first.do("move", target_deg=first.tags["pos_act_deg"] + 20.0)
        first.until(lambda tags: tags["vel_act_deg_s"] > 0.2)
        second.look()
        assert second.refused("take", over=True) == "SEC-08"
        viewer.do("stop")
        first.until(lambda tags: tags["at_rest"])
        second.until(lambda tags: tags["at_rest"] and tags["vel_act_deg_s"] < 0.01)
        second.do("take", over=True)
        first.until(lambda tags: tags["authority_user"] == "physicist")  # and so the new epoch
        assert first.refused("power", on=True) == "SEC-07"
        assert viewer.refused("take", over=False) == "SEC-01"


def test_control_is_given_back_by_its_holder_only(service: Service) -> None:
    with service.page("operator") as holder, service.page("physicist") as other:
        assert other.refused("give") == "SEC-07"  # it was done once, and journaled as done
        holder.do("take", over=False)
        other.until(lambda tags: tags["authority_user"] == "operator")
        assert other.refused("give") == "SEC-07"
        holder.until(lambda tags: tags["authority_user"] == "operator")
        holder.do("give")
        assert holder.refused("give") == "SEC-07"


def test_a_login_ends_the_session_and_the_page_that_its_browser_had(service: Service) -> None:
    with service.page("operator") as page:
        page.do("take", over=False)
        right = {"user": "viewer", "password": PASSWORD}
        assert service.request("POST", "/api/v1/login", right, page.cookie)[0] == 200
        with pytest.raises(ConnectionClosed) as closed:
            page.until(lambda _: False)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4401
    assert service.request("GET", "/api/v1/session", cookie=page.cookie)[0] == 401


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('{"type":"move","seq":1,"frame":"1-0123456789abcdef","epoch":1,"target_deg":NaN}', "SEC-05"),
        ('{"type":"move","seq":1,"frame":"1-0123456789abcdef","epoch":1,"target_deg":"5"}', "SEC-05"),
        ('{"type":"move","seq":1,"frame":"1-0123456789abcdef","epoch":1,"target_deg":1e999}', "SEC-05"),
        ('{"type":"stop","seq":1,"seq":2,"frame":1}', "SEC-05"),
        ('{"type":"stop","seq":true,"frame":1}', "SEC-05"),
        ("[" * 5000, "SEC-05"),
        ("stop", "SEC-05"),
    ],
)
def test_what_is_no_message_is_refused(service: Service, text: str, code: str) -> None:
    with service.page("operator") as page:
        page.socket.send(text)
        page.until(lambda _: bool(page.replies))
        assert page.replies.popitem()[1]["code"] == code


def test_only_the_page_itself_with_a_session_gets_a_socket(service: Service) -> None:
    cookie = {"Cookie": f"{COOKIE}={service.log_in('operator')}"}
    address, own = f"ws://{service.address}/api/v1/socket", f"http://{service.address}"
    for origin, headers, status in (
        ("http://elsewhere.example", cookie, 403),
        (None, cookie, 403),
        ("null", cookie, 403),
        (own, {}, 401),
        (own, {"Cookie": f"{COOKIE}={'0' * 32}"}, 401),
    ):
        with (
            pytest.raises(InvalidStatus) as refused,
            connect(address, origin=origin, additional_headers=headers),
        ):
            pass
        assert refused.value.response.status_code == status, (origin, headers)
    assert service.request("GET", "/api/v1/health", Host="rebound.example")[0] == 403


def test_rest_gives_what_the_role_may_see(service: Service) -> None:
    assert service.request("GET", "/api/v1/status")[0] == 401
    cookie = service.log_in("physicist")
    status, body, headers = service.request("GET", "/api/v1/status", cookie=cookie)
    assert status == 200
    assert json.loads(body)["tags"]["machine"] == "hust_gantry"
    assert "default-src 'none'" in headers["content-security-policy"]
    rows = json.loads(service.request("GET", "/api/v1/tags", cookie=cookie)[1])
    assert {row["name"] for row in rows} == set(json.loads(body)["tags"])
    status, body, _ = service.request("GET", "/api/v1/journal?from=0&limit=5", cookie=cookie)
    assert (status, len(body.splitlines())) == (200, 5)
    assert service.request("GET", "/api/v1/journal?from=-1", cookie=cookie)[0] == 400
    assert service.request("GET", "/api/v1/journal", cookie=service.log_in("operator"))[0] == 403
    assert service.request("POST", "/api/v1/logout", {}, cookie)[0] == 204
    assert service.request("GET", "/api/v1/status", cookie=cookie)[0] == 401


def test_a_recording_is_had_by_its_id_and_by_nothing_else(service: Service, tmp_path: Path) -> None:
    cookie = service.log_in("operator")
    with service.page("operator") as page:
        page.power_up()
        page.do("power", on=False)
        page.until(lambda tags: tags["power_phase"] == "off" and not tags["recording"])
        while not (rows := json.loads(service.request("GET", "/api/v1/traces", cookie=cookie)[1])):
            page.look()
    status, body, _ = service.request("GET", f"/api/v1/traces/{rows[0]['id']}", cookie=cookie)
    (tmp_path / "one.parquet").write_bytes(body)
    assert status == 200
    assert "pos_act_rad" in read_trace(tmp_path / "one.parquet").columns
    for wrong in (rows[0]["name"], "..%2f..%2fusers.json", "%2e%2e/users.json", "0" * 32, "", "."):
        status, body, _ = service.request("GET", f"/api/v1/traces/{wrong}", cookie=cookie)
        assert status in (200, 404)
        assert b"scrypt" not in body
        assert b"salt" not in body


def test_five_wrong_passwords_lock_this_account_and_no_other(service: Service) -> None:
    wrong = {"user": "nobody", "password": "x" * 12}
    answers = [service.request("POST", "/api/v1/login", wrong)[0] for _ in range(6)]
    assert answers == [401] * 5 + [429]
    right = {"user": "viewer", "password": PASSWORD}
    assert service.request("POST", "/api/v1/login", right, Origin="http://elsewhere.example")[0] == 403
    assert service.request("POST", "/api/v1/login", right)[0] == 200


def test_a_second_controller_on_the_same_machine_is_impossible(service: Service) -> None:
    for wanted in (["serve", "--no-page"], ["move", "1"]):
        done = service.command(*wanted)
        assert done.returncode == 3
        assert "in use by process" in done.stderr


FILES_ENTERED = Path(__file__).parents[1] / "support" / "files_entered.py"


def test_the_command_line_goes_to_the_service_when_it_is_told_to(service: Service) -> None:
    done = service.command("move", "--by", "0.2", "--speed", "0.6", "--service", "--yes", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert said["end_deg"] - said["start_deg"] == pytest.approx(0.2, abs=0.006)
    assert "add --service" in service.command("status").stderr
    assert service.command("attach").returncode == 0
    shown = service.command("status", "--json")
    assert json.loads(shown.stdout)["machine"] == "hust_gantry"
    assert service.command("jog", "-", "--for", "0.2").returncode == 0
    assert "30 s at most" in service.command("jog", "-", "--for", "31").stderr
    assert service.command("detach").returncode == 0


def test_a_move_at_the_service_enters_at_most_six_files_of_the_command_line(service: Service) -> None:
    """Files of `cli` and `operation` with a function called before the service is told to move; seven once."""
    done = subprocess.run(
        [sys.executable, FILES_ENTERED, "move", "--by", "0.1", "--service", "--yes"],
        env={**os.environ, "GANTRYCTL_STATE": str(service.root)},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    entered = json.loads(done.stderr)
    assert "cli/axis/service_axis.py" in entered
    assert len(entered) <= 6, entered


def test_the_command_line_takes_control_from_nobody(service: Service) -> None:
    with service.page("operator") as page:
        page.do("take", over=False)
        asked = subprocess.Popen(
            [sys.executable, "-m", "gantryctl", "move", "1", "--service", "--yes"],
            env={**os.environ, "GANTRYCTL_STATE": str(service.root)}, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        page.until(lambda _: asked.poll() is not None)
        assert "operator has control" in asked.communicate()[1]


def raw(service: Service, text: bytes) -> bytes:
    """Bytes as they are, on a connection of their own; everything until it is closed."""
    host, port = service.address.split(":")
    with socket.create_connection((host, int(port)), timeout=30.0) as made:
        answer = b""
        with suppress(ConnectionError):  # closed while we were still sending
            made.sendall(text)
            while more := made.recv(65536):
                answer += more
        return answer


def test_slow_and_huge_requests_are_ended_and_others_are_served(service: Service) -> None:
    host = f"Host: {service.address}\r\n".encode()
    assert raw(service, b"GET /api/v1/health HTTP/1.1\r\n" + host) == b""  # never finished: closed after 5 s
    huge = b"POST /api/v1/login HTTP/1.1\r\n" + host + b"Content-Length: 70000\r\nConnection: close\r\n\r\n"
    assert b" 413 " in raw(service, huge).splitlines()[0]
    endless = b"GET /" + b"a" * 200_000 + b" HTTP/1.1\r\n\r\n"
    assert b"200" not in raw(service, endless)
    assert service.request("GET", "/api/v1/health")[0] == 200


def asked(service: Service) -> tuple[int, str | None]:
    """Status and `Retry-After` of one request of a stranger on this machine."""
    host, port = service.address.split(":")
    with closing(http.client.HTTPConnection(host, int(port), 30.0)) as made:
        made.request("GET", "/api/v1/health")
        answer = made.getresponse()
        answer.read()
        return answer.status, answer.getheader("Retry-After")


def test_too_many_requests_are_refused_for_their_own_address_and_stop_is_not(service: Service) -> None:
    with service.page("viewer") as page:
        cookie = service.log_in("operator")
        answers = [asked(service) for _ in range(60)]
        while (429, "1") not in answers:  # 40 in reserve, 10 a second
            answers.append(asked(service))
        assert answers[0] == (200, None)
        # Whoever is logged in on this machine, and whoever wants to, does not wait with its strangers.
        assert service.request("GET", "/api/v1/status", cookie=cookie)[0] == 200
        with service.page("operator") as another:
            another.do("stop")
        page.do("stop")


def ended(service: Service, after: int) -> int:
    """Connections of the operator that the journal saw end after this event."""
    rows = read_journal(service.directory, after)
    return sum((row.values["user"], row.values["text"]) == ("operator", "disconnected") for row in rows)


@pytest.mark.slow
def test_connections_that_never_read_are_ended_and_others_see_everything(service: Service) -> None:
    with service.page("viewer") as lively:
        after = read_journal(service.directory, newest=True)[-1].seq
        stuck = [service.page("operator") for _ in range(8)]  # nobody reads: their buffers fill up
        issued_ms = [lively.look()["issued_ms"]]
        lively.until(lambda tags: issued_ms.append(tags["issued_ms"]) or ended(service, after) == len(stuck))
        frames = (issued_ms[-1] - issued_ms[0]) / lively.welcome["frame_ms"]
        assert (
            frames - len(issued_ms) < 0.2 * frames
        )  # of a busy machine, not of a connection that waits for others
        for page in stuck:
            page.socket.socket.close()


def flood(page: Page) -> None:
    for _ in range(100_000):
        page.socket.send('{"type":"stop","seq":1,"frame":1}')
        page.socket.recv()


def test_a_flood_of_messages_closes_only_its_own_connection(service: Service) -> None:
    with service.page("viewer") as calm, service.page("operator") as wild:
        codes = [wild.ask("take", over=False)["code"] for _ in range(30)]
        assert codes[:15] == [""] * 15
        assert "SEC-06" in codes
        with pytest.raises(ConnectionClosed) as closed:
            flood(wild)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4429
        calm.do("stop")
        calm.until(lambda tags: tags["authority_user"] == "")


def test_a_page_over_tls_works_and_its_cookie_is_secure(tmp_path: Path) -> None:
    files = [str(tmp_path / name) for name in ("cert.pem", "key.pem")]
    made = subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2",
         "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-out", files[0], "-keyout", files[1]],
        capture_output=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    add_users(tmp_path)
    trusting = ssl.create_default_context(cafile=files[0])
    with Service(tmp_path, "--tls-cert", files[0], "--tls-key", files[1], "--name", "localhost") as secure:
        asked = urllib.request.Request(
            f"https://{secure.address}/api/v1/login",
            json.dumps({"user": "viewer", "password": PASSWORD}).encode(),
            {"Content-Type": "application/json"},
        )
        assert "cert.pem: expires in 2 days" in secure.errors()
        with urllib.request.urlopen(asked, context=trusting) as answer:
            cookie = answer.headers["set-cookie"]
            assert answer.headers["strict-transport-security"]
        assert cookie.startswith("__Host-")
        parts = {part.strip() for part in cookie.split(";")}
        assert {"Secure", "HttpOnly", "SameSite=strict", "Path=/"} <= parts
        assert "domain" not in cookie.lower()
        with connect(
            f"wss://{secure.address}/api/v1/socket",
            ssl=trusting,
            origin=f"https://{secure.address}",
            additional_headers={"Cookie": cookie.partition(";")[0]},
        ) as live:
            assert json.loads(live.recv())["role"] == "viewer"


def test_opc_ua_shows_the_axis_in_a_process_of_its_own(tmp_path: Path) -> None:
    pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
    add_users(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with Service(tmp_path, "--opcua", f"127.0.0.1:{port}") as service, service.page("viewer") as page:
        made = service.directory / "opcua" / "certificate.der"

        def listening(_: object) -> bool:
            with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
                return made.exists()
            return False

        page.until(listening)
        (made.parent / "trusted" / "another.der").write_bytes(made.read_bytes())

        def read_again(_: object) -> bool:
            rows = read_journal(service.directory, newest=True)
            return any("the trust list was read again" in row.values["text"] for row in rows)

        page.until(read_again)
        os.kill(service.child("gateway.opcua"), signal.SIGKILL)
        page.until(lambda _: "SYS-06 opcua ended with code -9" in service.errors())
        assert service.request("GET", "/api/v1/health")[0] == 200
