"""A browser that reaches the service from another address, over TLS, in a network of its own.

Runs inside `private_network.sh`: `python remote_screen.py FOLDER`; prints one JSON object. The address is one of those
kept for documentation, on the loopback interface: nobody else reaches it, and to the service it is not loopback.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import BrowserContext, Error, Page, Playwright, expect, sync_playwright

from support.browser import CHROMIUM, FLAGS, SIZE, take_control
from support.service_process import PASSWORD, RELEASED, Service, add_users

HOST, NAME = "198.51.100.7", "gantry.example"


def certificate(folder: Path) -> tuple[Path, Path]:
    """Self-signed, for the name."""
    made, key = folder / "cert.pem", folder / "key.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2",
         "-subj", f"/CN={NAME}", "-addext", f"subjectAltName=DNS:{NAME}", "-out", made, "-keyout", key],
        capture_output=True, check=True,
    )  # fmt: skip
    return made, key


def pin(made: Path) -> str:
    """The flag with which the browser trusts this key and no other."""
    pem = subprocess.run(
        ["openssl", "x509", "-in", made, "-pubkey", "-noout"], capture_output=True, check=True
    )
    der = subprocess.run(
        ["openssl", "pkey", "-pubin", "-outform", "der"], input=pem.stdout, capture_output=True, check=True
    )
    digest = base64.b64encode(hashlib.sha256(der.stdout).digest()).decode()
    return f"--ignore-certificate-errors-spki-list={digest}"


def browser(playwright: Playwright, folder: Path, *flags: str) -> BrowserContext:
    return playwright.chromium.launch_persistent_context(
        str(folder), executable_path=CHROMIUM, viewport=SIZE, locale="en-GB",
        args=[*FLAGS, f"--host-resolver-rules=MAP {NAME} {HOST}", *flags],
    )  # fmt: skip


def stranger_says(playwright: Playwright, folder: Path, url: str) -> str:
    """What a browser says that was not told to trust the key."""
    context = browser(playwright, folder)
    try:
        context.pages[0].goto(url)
    except Error as refused:
        return refused.message.split(" at ")[0]
    finally:
        context.close()
    return "opened"


def log_in(page: Page) -> None:
    page.get_by_label("User").fill("operator")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Log in").click()
    page.locator("[data-stale=false]").wait_for()


def choose_speed(page: Page, rpm: str) -> None:
    page.locator("#tab-settings").click()
    setting = page.locator("form.setting").filter(has=page.locator("#speed_setting_deg_s"))
    setting.get_by_role("textbox").fill(rpm)
    setting.get_by_role("button", name="Set").click()
    expect(page.locator("output[data-tag=speed_setting_deg_s]")).to_contain_text(rpm)
    page.locator("#tab-operation").click()


def fast_and_slow(page: Page) -> dict[str, object]:
    """Above the cap nothing is offered; below it the axis moves."""
    page.locator("#tab-operation").click()
    take_control(page)
    page.get_by_role("button", name="Power on").click()
    page.get_by_text("Power: on").wait_for()
    page.get_by_role("button", name="continuous", exact=True).click()
    page.get_by_label("Target").fill("3")
    move, key = page.locator(".move form > button").first, page.locator("[data-hold=forward]")
    choose_speed(page, "0.2")
    page.get_by_label("Target").fill("3")
    expect(key).to_be_disabled()
    found: dict[str, object] = {"fast": [key.get_attribute("title"), move.get_attribute("title")]}
    choose_speed(page, "0.15")
    page.get_by_label("Target").fill("3")
    found["slow"] = [key.is_enabled(), move.is_enabled()]
    move.click()
    expect(page.locator(".overview [data-tag=vel_act_deg_s]")).to_have_text("0.90", timeout=20_000)
    page.get_by_role("button", name="Stop", exact=True).click()
    return found


def look(playwright: Playwright, folder: Path, service: Service, made: Path) -> dict[str, object]:
    url = f"https://{service.address}/"
    found: dict[str, object] = {"stranger": stranger_says(playwright, folder / "stranger", url)}
    context = browser(playwright, folder / "trusting", pin(made))
    page = context.pages[0]
    answer = page.goto(url)
    assert answer is not None
    found["hsts"] = answer.headers.get("strict-transport-security")
    log_in(page)
    found["cookies"] = context.cookies()
    found["readable"] = page.evaluate("() => document.cookie")
    found["cap"] = page.get_by_test_id("remote").inner_text()
    found |= fast_and_slow(page)
    page.goto(url.replace("https:", "http:"))
    found["plain"] = page.url
    context.close()
    return found


def main(folder: Path) -> None:
    subprocess.run(["ip", "address", "add", f"{HOST}/32", "dev", "lo"], check=True)
    (folder / "sitecustomize.py").write_text(RELEASED)
    os.environ["PYTHONPATH"] = os.pathsep.join([str(folder), os.environ["PYTHONPATH"]])
    add_users(folder)
    made, key = certificate(folder)
    options = ("--listen", f"{HOST}:0", "--tls-cert", str(made), "--tls-key", str(key), "--name", NAME)
    with Service(folder, *options) as service, sync_playwright() as playwright:
        print(json.dumps(look(playwright, folder, service, made)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
