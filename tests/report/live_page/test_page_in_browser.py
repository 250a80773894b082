"""Pages in a real browser: sliders, links, and no other requests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_benches import BENCHES, VARIED

import bywire
from screenshots.subjects import SUBJECTS
from screenshots.taken import differing, taken

DAILY = 3  # positions of sliders
READY = "() => run !== null && !busy"
MOVE = """(shares) => {
  run = null;
  for (const [name, share] of Object.entries(shares)) {
    const slider = rows.get(name).row.querySelector("input[type=range]");
    slider.value = share;
    slider.dispatchEvent(new Event("input"));
  }
}"""
GIVEN = """() => ({
  time: Array.from(run.time), changes: changes(), rows: place("figures").tBodies[0].rows.length,
  signals: Object.fromEntries(Object.entries(run.signals).map(([n, c]) => [n, Array.from(c)])),
})"""
EDGES = """() => [...document.querySelectorAll("#figures th[scope=col]")]
  .map((each) => [each.textContent, each.getBoundingClientRect().right])"""
SAID = '() => place("message").hidden ? "" : place("message").textContent'


class Tab:
    """A page in the browser, with its messages and requests."""

    def __init__(self, opened: Any, file: Path) -> None:
        self.file, self.noise = file, list[str]()
        self.page = opened.new_page(viewport={"width": 1280, "height": 800})
        self.page.on("console", lambda said: self.noise.append(f"console: {said.text}"))
        self.page.on("pageerror", lambda error: self.noise.append(f"error: {error}"))
        self.page.on("dialog", lambda dialog: self.noise.append(f"dialog: {dialog.message}"))
        self.page.on("request", self._asked)

    def _asked(self, request: Any) -> None:
        if not request.url.startswith((self.file.as_uri(), "blob:")):
            self.noise.append(f"request: {request.url}")

    def open(self, link: str = "") -> None:
        """Reload the page and wait for its first run."""
        self.page.goto("about:blank")
        self.page.goto(self.file.as_uri() + link)
        self.page.wait_for_function(READY)

    def moved(self, shares: dict[str, int]) -> dict[str, Any]:
        """Return the run after sliders were moved, to thousandths of their travel."""
        self.page.evaluate(MOVE, shares)
        self.page.wait_for_function(READY)
        given: dict[str, Any] = self.page.evaluate(GIVEN)
        return given


@pytest.fixture(scope="module", params=sorted(BENCHES))
def tab(request: pytest.FixtureRequest, chromium: Any, tmp_path_factory: Any) -> Iterator[Tab]:
    name = str(request.param)
    file = tmp_path_factory.mktemp("pages") / f"{name}.html"
    bywire.page(BENCHES[name], file, vary=VARIED[name])
    made = Tab(chromium, file)
    made.open()
    yield made
    made.page.close()


def agrees(tab: Tab, count: int) -> None:
    """Check runs at random positions of the chosen sliders against the bench."""
    name, rng = tab.file.stem, np.random.default_rng(11)
    for _ in range(count):
        shares = {n: int(rng.integers(300, 700)) for n in VARIED[name]}
        given = tab.moved(shares)
        assert given["changes"].keys() == shares.keys()
        recording = bywire.run(BENCHES[name].with_overrides(given["changes"])).recording
        np.testing.assert_allclose(given["time"], recording["time"], atol=1e-12)
        for signal, values in given["signals"].items():
            wanted = recording[signal].values
            scale = max(np.abs(wanted).max(), 1e-300)
            assert np.abs(np.array(values) - wanted).max() <= 1e-9 * scale, signal
    assert not tab.noise
    assert not tab.page.evaluate(SAID)


def test_sliders_give_what_the_bench_gives(tab):
    agrees(tab, DAILY)


@pytest.mark.trust
def test_a_hundred_positions_of_sliders_give_what_the_bench_gives(tab):
    agrees(tab, 100)


def test_loops_are_drawn_when_sliders_rest(tab):
    tab.moved({VARIED[tab.file.stem][0]: 450})
    tab.page.wait_for_function("() => place('loops').textContent.includes('phase margin')")
    assert tab.page.locator("#loops canvas").count() == 2  # gain and phase
    assert not tab.noise


def test_panels_out_of_sight_follow_when_sliders_rest(tab):
    tab.open()
    tab.page.wait_for_timeout(300)
    panel = "[...document.querySelectorAll('#curves canvas')].at(-1)"
    assert tab.page.evaluate(f"() => {panel}.getBoundingClientRect().top > 1.2 * innerHeight")
    before = tab.page.evaluate(f"() => {panel}.toDataURL()")
    tab.moved({VARIED[tab.file.stem][0]: 350})
    tab.page.wait_for_function(f"(before) => {panel}.toDataURL() !== before", arg=before)
    assert not tab.noise


def test_a_link_restores_what_was_moved(tab):
    given = tab.moved({name: 417 for name in VARIED[tab.file.stem]})
    count = len(VARIED[tab.file.stem])  # the address changes once sliders are at rest
    tab.page.wait_for_function(f"() => location.hash.split('&').length > {count}")
    tab.open(tab.page.evaluate("() => location.hash"))
    again = tab.page.evaluate(GIVEN)
    assert again["changes"] == given["changes"]  # to the last bit
    assert again["signals"] == given["signals"]
    assert not tab.noise


@pytest.mark.parametrize(
    ("link", "text"),
    [
        ("bench=0123&{name}=0.5", "another bench or version"),
        ("bench={digest}&{name}=-1e300", "must be"),
        ("bench={digest}&{name}=<img src=x onerror=alert(1)>", "must be"),
        ("bench={digest}&__proto__=1", "not a parameter of this page"),
        ("bench={digest}&%3Cscript%3Ealert(1)%3C/script%3E=1", "not a parameter of this page"),
    ],
)
def test_hostile_links_say_so_and_do_nothing_else(tab, link, text):
    name = VARIED[tab.file.stem][0]
    tab.open("#" + link.format(digest=tab.page.evaluate("() => digest"), name=name))
    assert text in tab.page.evaluate(SAID)
    assert tab.page.evaluate("() => changes()") == {}
    assert tab.page.evaluate("() => document.querySelectorAll('#message *').length") == 0
    assert not tab.noise


def test_a_value_typed_in_is_taken_or_refused_in_words(tab):
    tab.open()
    name = VARIED[tab.file.stem][0]
    field = tab.page.locator(f"[id='p-{name}']")
    field.fill("-7")
    field.press("Enter")
    assert "must be" in tab.page.evaluate(SAID)
    assert field.get_attribute("aria-invalid") == "true"
    field.fill("0,31")
    field.press("Enter")
    tab.page.wait_for_function(READY)
    assert list(tab.page.evaluate("() => changes()")) == [name]
    assert not tab.page.evaluate(SAID)


STATE = """() => ({
  said: place("message").hidden ? "" : place("message").textContent,
  isOld: place("shown").classList.contains("stale"), hasNote: !place("stale").hidden,
  isShown: !place("shown").hidden, canSave: !place("csv").disabled,
  loops: [...document.querySelectorAll("#loops p[role=status]")].map((each) => each.textContent),
})"""


def typed(tab: Tab, name: str, text: str) -> dict[str, Any]:
    """Type a value into a field, and return the content of the page after the computation."""
    field = tab.page.locator(f"[id='p-{name}']")
    field.evaluate("(each) => each.closest('details')?.setAttribute('open', '')")
    field.fill(text)
    field.press("Enter")
    tab.page.wait_for_function("() => !busy")
    tab.page.wait_for_timeout(400)  # loops are computed once fields are at rest
    state: dict[str, Any] = tab.page.evaluate(STATE)
    return state


def test_values_with_units_are_taken_and_an_invalid_field_marks_the_results(tab):
    if tab.file.stem != "motorcycle":
        pytest.skip("one page is enough")
    tab.open()
    for text, value in (("0.4 ohm", 0.4), ("410 mΩ", 0.41), ("4.2e-4 kohm", 0.42), ("0,43", 0.43)):
        state = typed(tab, "motor.R_m", text)
        assert (state["said"], state["isOld"], state["hasNote"]) == ("", False, False)
        assert tab.page.evaluate("() => values['motor.R_m']") == value
    refused = typed(tab, "motor.R_m", "0.4 V")
    assert 'motor.R_m must be > 0 ohm, not "0.4 V"' in refused["said"]
    assert refused["isOld"]
    assert refused["hasNote"]
    assert tab.page.evaluate("() => values['motor.R_m']") == 0.43
    still = typed(tab, "motor.K_e", "0.03")  # another field is valid; this one stays invalid
    assert (still["said"], still["isOld"]) == (refused["said"], True)
    mended = typed(tab, "motor.R_m", "0.4")
    assert (mended["said"], mended["isOld"], mended["hasNote"]) == ("", False, False)
    typed(tab, "motor.R_m", "none")
    tab.page.locator("#reset").click()
    tab.page.wait_for_function(READY)
    assert tab.page.evaluate(STATE)["said"] == ""
    assert tab.page.locator("[aria-invalid=true]").count() == 0
    assert not tab.noise


@pytest.mark.parametrize("text", ["10", "20", "1e6"])
def test_values_that_open_the_loop_leave_nothing_of_the_loop_before(tab, text):
    if tab.file.stem != "motorcycle":
        pytest.skip("one page is enough")
    tab.open()
    before = typed(tab, "motor.R_m", "0.4")["loops"]
    state = typed(tab, "motor.R_m", text)
    assert state["said"] == ""
    assert state["isShown"]
    assert not state["isOld"]
    assert state["loops"] != before
    assert "undefined" not in "".join(state["loops"])
    assert not tab.noise


def test_a_run_that_fails_takes_the_results_away(tab):
    tab.open()
    tab.page.evaluate("() => answered({ data: { error: 'there is no state at rest' } })")
    state = tab.page.evaluate(STATE)
    assert state["said"] == "there is no state at rest"
    assert not state["isShown"]
    assert not state["canSave"]
    name = VARIED[tab.file.stem][0]
    tab.moved({name: 480})
    state = tab.page.evaluate(STATE)
    assert (state["said"], state["isShown"], state["canSave"]) == ("", True, True)
    assert not tab.noise


def test_a_run_that_takes_too_long_is_given_up_and_the_next_one_is_computed(tab):
    if tab.file.stem != "motorcycle":
        pytest.skip("one page is enough")
    tab.open()
    tab.page.evaluate("() => { changed('motor.R_m', 0.4); giveUp(); }")
    tab.page.wait_for_function("() => !busy")
    assert "and was stopped" in tab.page.evaluate(SAID)
    assert not tab.page.evaluate(STATE)["isShown"]
    assert typed(tab, "motor.R_m", "0.41")["said"] == ""
    assert tab.page.evaluate(STATE)["isShown"]
    assert not tab.noise


def test_a_figure_that_cannot_be_drawn_is_said(tab):
    tab.open()
    broken = "() => { setTimeout(() => { throw new RangeError('Invalid array length'); }); }"
    tab.page.evaluate(broken)
    tab.page.wait_for_function("() => !place('message').hidden")
    state = tab.page.evaluate(STATE)
    assert state["said"] == "the results with these values cannot be drawn"
    assert not state["isShown"]
    tab.noise.clear()


RANGES = """() => {
  window.ranges = [];
  const rangeNum = uPlot.rangeNum;
  uPlot.rangeNum = (low, high, ...others) => {
    ranges.push([low, high]);
    return rangeNum(low, high, ...others);
  };
}"""
SHOWN = """([from, to]) => {
  const isIn = (_, k) => run.time[k] >= from && run.time[k] <= to;
  const values = panels[0].traces.flatMap(({ name }) =>
    [...converted(run.signals[name], panels[0])].filter(isIn));
  return [Math.min(...values), Math.max(...values)];
}"""


def test_the_ordinate_fits_a_part_of_the_time_and_new_values_keep_it(tab):
    tab.open()
    tab.page.wait_for_function("() => place('loops').textContent.includes('phase margin')")
    tab.page.wait_for_timeout(400)
    tab.page.evaluate(RANGES)
    over = tab.page.locator("#curves .u-over").first.bounding_box()
    height = over["y"] + 0.5 * over["height"]
    tab.page.mouse.move(over["x"] + 0.4 * over["width"], height)
    tab.page.mouse.down()
    tab.page.mouse.move(over["x"] + 0.6 * over["width"], height, steps=4)
    tab.page.mouse.up()
    tab.page.wait_for_function("() => ranges.length")
    time = tab.page.evaluate(GIVEN)["time"]
    part = [time[0] + share * (time[-1] - time[0]) for share in (0.4, 0.6)]
    shown, whole = (tab.page.evaluate(SHOWN, each) for each in (part, [time[0], time[-1]]))
    ranges = tab.page.evaluate("() => ranges")
    close = 0.1 * (whole[1] - whole[0])
    assert any(each == pytest.approx(shown, abs=close) for each in ranges)
    if tab.file.stem == "motorcycle":  # all pulses of the other bench look alike
        assert shown[1] - shown[0] < 0.8 * (whole[1] - whole[0])
    tab.page.evaluate("() => { ranges.length = 0; }")
    tab.moved({VARIED[tab.file.stem][0]: 480})
    tab.page.wait_for_function("() => ranges.length")
    shown, ranges = tab.page.evaluate(SHOWN, part), tab.page.evaluate("() => ranges")
    assert any(each == pytest.approx(shown, abs=close) for each in ranges)
    assert not tab.noise


def test_the_pointer_reads_values_with_units(tab):
    tab.open()
    tab.page.wait_for_timeout(400)
    over = tab.page.locator("#curves .u-over").first.bounding_box()
    before = tab.page.locator("#curves .u-legend").first.bounding_box()
    tab.page.mouse.move(over["x"] + 0.5 * over["width"], over["y"] + 0.5 * over["height"])
    tab.page.wait_for_timeout(300)
    legend = tab.page.locator("#curves .u-legend").first
    values = legend.locator(".u-value").all_inner_texts()
    unit = tab.page.evaluate("() => panels[0].unit")
    assert values[0].endswith(" ms") or values[0].endswith(" s")
    assert values[1].endswith(f" {unit}")
    assert legend.bounding_box()["height"] == before["height"]
    assert not tab.noise


def test_kept_runs_are_columns_of_the_key_figures(tab):
    if tab.file.stem != "motorcycle":
        pytest.skip("the other page judges no key figures")
    tab.open()
    heads = (
        "() => [...document.querySelectorAll('#figures thead th')].map((e) => e.firstChild.data)"
    )
    assert tab.page.evaluate(heads)[:3] == ["figure", "value", "limit"]
    value = tab.page.locator("#figures tbody tr").first.locator("td").first.inner_text()
    tab.page.click("#keep")
    tab.moved({"motor.R_m": 650})
    tab.page.click("#keep")
    assert tab.page.evaluate(heads)[:5] == ["figure", "this run", "run 1", "run 2", "limit"]
    cells = tab.page.locator("#figures tbody tr").first.locator("td").all_inner_texts()
    assert cells[1] == value  # of the bench's values
    assert cells[0] == cells[2] != value
    assert tab.page.locator("#kept li").all_inner_texts()[0].startswith("run 1: bench values")
    judged = tab.page.locator("#figures tr", has_text="overshoot").locator(".met, .missed")
    assert judged.count() == 3  # kept runs are judged too
    tab.page.click("#figures [aria-label='drop run 1']")
    assert tab.page.evaluate(heads)[:4] == ["figure", "this run", "run 2", "limit"]
    tab.page.click("#kept [aria-label='drop run 2']")
    assert tab.page.evaluate(heads)[:3] == ["figure", "value", "limit"]
    assert not tab.noise


def test_what_a_page_may_not_do_is_blocked_and_seen(tab):
    tab.open()
    tab.page.evaluate("() => fetch('https://example.org/').catch(() => undefined)")
    inline = """() => {
      const script = document.createElement("script");
      script.textContent = "run = null";
      document.body.append(script);
    }"""
    tab.page.evaluate(inline)
    assert tab.page.evaluate("() => run !== null")
    assert any("connect" in said for said in tab.noise)
    assert any("inline script" in said for said in tab.noise)
    tab.noise.clear()


def test_a_file_that_is_dropped_is_not_read(tab):
    tab.open()
    drop = """() => {
      const moved = new DataTransfer();
      moved.items.add(new File(["[bench]"], "huge.toml"));
      const event = new DragEvent("drop", { dataTransfer: moved, cancelable: true, bubbles: true });
      document.body.dispatchEvent(event);
      return event.defaultPrevented;
    }"""
    assert tab.page.evaluate(drop)
    assert "cannot open files" in tab.page.evaluate(SAID)
    assert not tab.noise


def test_a_browser_without_webassembly_is_told_so(tab, chromium):
    context = chromium.new_context()
    context.add_init_script("delete globalThis.WebAssembly")
    page = context.new_page()
    page.goto(tab.file.as_uri())
    assert "cannot run WebAssembly" in page.evaluate(SAID)
    context.close()


@pytest.mark.parametrize("suffix", ["", "-phone"])
def test_a_page_looks_as_it_is_stored_in_both_themes(tab, chromium, suffix):
    name = f"page-{tab.file.stem}{suffix}"
    if name not in SUBJECTS:
        pytest.skip("one phone is enough")
    subject = SUBJECTS[name]
    assert not differing(name, taken(chromium, tab.file.as_uri(), subject.width, subject.ready))


def test_a_report_looks_as_it_is_stored_in_both_themes(chromium, tmp_path):
    address = SUBJECTS["report"].write(tmp_path).as_uri()
    assert not differing("report", taken(chromium, address))


def test_a_panel_that_is_missing_is_seen(tab, chromium):
    name = f"page-{tab.file.stem}"
    hide = "() => { document.querySelectorAll('#curves canvas')[1].style.visibility = 'hidden'; }"
    shots = taken(
        chromium, tab.file.as_uri(), ready=SUBJECTS[name].ready, change=hide, themes=["dark"]
    )
    assert "differs" in differing(name, shots)


def test_ranges_that_a_source_states_are_bands(tab):
    count = """() => {
      const canvas = document.querySelector("#curves canvas");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      const faint = data.filter((alpha, k) => k % 4 === 3 && alpha > 30 && alpha < 50);
      return faint.length / (data.length / 4);
    }"""
    tab.open()
    stated = sum(each["high"] - each["low"] for each in tab.page.evaluate("() => panels[0].stated"))
    assert (stated > 0.0) == (tab.file.stem == "wedge")
    assert (tab.page.evaluate(count) > 0.05) == (stated > 0.0)


def test_two_kept_runs_leave_the_stated_values_in_view(chromium, tmp_path):
    file = tmp_path / "kept.html"
    bywire.page("hard-braking", file)
    tab = Tab(chromium, file)
    tab.page.set_viewport_size({"width": 1400, "height": 900})
    tab.open()
    for share in (600, 700):
        tab.page.click("#keep")
        tab.moved({"motor.R_m": share})
    shown = dict(tab.page.evaluate(EDGES))
    tab.page.close()
    assert list(shown)[-2:] == ["limit", "stated"]
    assert len(shown) == 6
    assert max(shown.values()) <= 1400
