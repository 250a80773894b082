"""The pages of a server in a real browser: forms, dropped files, jobs, and no other request."""

from __future__ import annotations

import os

import pytest

NEWEST = '() => document.querySelector("#jobs li")?.className'


@pytest.mark.skipif(os.name != "posix", reason="processes of POSIX")
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
    page.press("form[data-task=run] button", "Enter")
    page.wait_for_function(f"() => ({NEWEST})() === 'held'")
    report = page.get_attribute("#jobs li a", "href")
    assert report.startswith("/file/results/run-curve-")
    # another, canceled
    page.fill("#run-set", "")
    page.click("form[data-task=run] button")
    page.wait_for_selector("#jobs progress")
    page.focus("#jobs button")
    page.keyboard.press("Enter")
    page.wait_for_function(f"() => ({NEWEST})() === 'canceled'")
    # files: one that is taken, one that is too large, one of no format
    assert noise == []
    upload = "form[data-task=replay] .upload"
    (tmp_path / "a rig.csv").write_text("time,p\n0,1\n")
    page.set_input_files(upload, tmp_path / "a rig.csv")
    page.wait_for_function(
        '() => document.querySelector("#replay-measurement").value === "measurements/a-rig.csv"'
    )
    (tmp_path / "large.csv").write_bytes(bytes(3_000_001))
    page.set_input_files(upload, tmp_path / "large.csv")
    page.wait_for_selector("text=large.csv has 4 MB, and 3 MB are taken")
    (tmp_path / "text.docx").write_text("x")
    page.set_input_files(upload, tmp_path / "text.docx")
    page.wait_for_selector("text='text.docx' has the ending of no measurement format")
    assert [path.name for path in (visit.folder / "measurements").iterdir()] == ["a-rig.csv"]
    # what the folder holds may not ask the server
    (visit.folder / "page.html").write_text(
        "<p>mute</p><script>fetch('/api/jobs').then(() => { document.body.textContent = 'read' })"
        "</script>"
    )
    before = len(asked)
    page.goto(f"{page.url.partition('/bench')[0]}/file/page.html")
    page.wait_for_load_state("networkidle")
    assert page.inner_text("body") == "mute"
    assert len(asked) == before + 1
    here = visit.server.link.partition("/?")[0]
    assert [url for url in asked if not url.startswith(here)] == []
    page.close()
