"""The pages in a real browser: every picture has a size, the robot is drawn, buttons work, and the console is silent.

Needs chromium (Debian's package); skipped where it is not installed. The page reports on itself: a probe that is added
to a copy of it writes what it finds into the document, which the browser then prints (--dump-dom).
"""

import asyncio
import base64
import hashlib
import html
import json
import re
import shutil
import subprocess

import pytest

from fidim_lab.app.report.pages.write import write_report

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason="no chromium here: apt install chromium"),
]
PROBE = """
const wrong = [];
document.addEventListener("securitypolicyviolation", (event) => wrong.push("policy: " + event.violatedDirective));
window.addEventListener("error", (event) => wrong.push(String(event.message)));
window.addEventListener("load", () => {
  const sized = [...document.querySelectorAll(".card > svg")].map((svg) => {
    const box = svg.getBoundingClientRect();
    return { shown: getComputedStyle(svg).display !== "none", width: box.width, height: box.height,
             lines: svg.querySelectorAll("path").length };
  });
  const canvas = document.querySelector(".solid canvas");
  const pixels = () => {
    const seen = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let sum = 0, inked = 0;
    for (let k = 3; k < seen.length; k += 4) { if (seen[k]) { inked += 1; sum = (sum * 31 + k) % 1000003; } }
    return [inked, sum];
  };
  const first = pixels();
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
  const turned = pixels();
  const picture = document.querySelector(".card.zoom");
  const svg = picture.querySelector("svg");
  const whole = svg.getAttribute("viewBox");
  const [larger, , all] = picture.querySelectorAll("button");
  larger.click();
  const zoomed = svg.getAttribute("viewBox");
  all.click();
  const found = { wrong, sized, first, turned, whole, zoomed, back: svg.getAttribute("viewBox"),
                  copies: document.querySelectorAll(".copyable button").length,
                  wide: document.documentElement.scrollWidth > window.innerWidth };
  const told = document.createElement("pre");
  told.id = "told";
  told.textContent = JSON.stringify(found);
  document.body.append(told);
});
"""


def probed(page, *, width=1200):
    """What the probe found in a page, and what the browser said on its console."""
    text = page.read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(PROBE.encode()).digest()).decode()
    assert "script-src '" in text
    text = text.replace("script-src '", f"script-src 'sha256-{digest}' '", 1).replace(
        "<style>", f"<script>{PROBE}</script><style>", 1
    )
    copy = page.with_name("probed.html")
    copy.write_text(text, encoding="utf-8")
    profile = page.with_name("profile")
    done = subprocess.run(
        [
            BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
            f"--user-data-dir={profile}", f"--window-size={width},1600",
            "--virtual-time-budget=5000", "--dump-dom", copy.as_uri(),
        ],
        capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    told = re.search(r'<pre id="told">(.*?)</pre>', done.stdout, re.DOTALL)
    assert told, done.stderr[-2000:]
    lines = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    console = [line for line in lines if "getImageData" not in line]  # the probe's own way of looking
    return json.loads(html.unescape(told[1])), console


@pytest.fixture
def page(campaign, write_folder, result_of, tmp_path):
    folder = write_folder(campaign, journal=True, truth=True)
    return write_report(folder, result_of(campaign), tmp_path / "report.html")


def test_every_picture_is_there_and_the_console_is_silent(page):
    found, console = probed(page)
    assert console == []
    assert found["wrong"] == []
    hidden = [one for one in found["sized"] if not one["shown"]]
    assert len(hidden) == 1  # the robot's still picture, for print
    shown = [one for one in found["sized"] if one["shown"]]
    assert len(shown) == 2 * 4 + 3 + 3 + 1  # two for each window, …, the parameters' correlations
    assert all(one["width"] > 200 and one["height"] > 60 and one["lines"] > 3 for one in shown)


def test_the_robot_turns_and_pictures_zoom(page):
    found, _ = probed(page)
    assert found["first"][0] > 500
    assert found["turned"][1] != found["first"][1]
    assert found["zoomed"] != found["whole"]
    assert found["back"] == found["whole"]
    assert found["copies"] == 4


def test_a_telephone_does_not_scroll_sideways(page):
    assert not probed(page, width=500)[0]["wide"]


def test_in_print_the_still_picture_stands_in_for_the_canvas(page, tmp_path):
    out = tmp_path / "report.pdf"
    subprocess.run(
        [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'printing'}",
         f"--print-to-pdf={out}", page.as_uri()],
        capture_output=True, timeout=300, check=True,
    )  # fmt: skip
    assert out.read_bytes().startswith(b"%PDF")
    assert out.stat().st_size > 20_000


def test_it_asks_nobody_for_anything_and_is_small(page, browser):
    assert page.stat().st_size < 3_000_000

    async def look():
        async with browser() as tab:
            await tab.go(page.as_uri())
            await tab.tell(
                "Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0
            )
            await tab.evaluate("document.querySelector('.card.zoom button').click()")
            await tab.tell("Emulation.setEmulatedMedia", media="print")
            hidden = await tab.evaluate("getComputedStyle(document.querySelector('.solid canvas')).display")
            return tab.asked, tab.console, hidden, await tab.pdf()

    asked, console, hidden, pdf = asyncio.run(look())
    assert {address.partition(":")[0] for address in asked} <= {"file", "data"}
    assert console == []
    assert hidden == "none"
    pages = re.findall(rb"/Type\s*/Page\b", pdf)
    assert 3 <= len(pages) <= 20
