/* The page: parameter values in, curves out, the latest value first. */

const read = (id) => JSON.parse(document.getElementById(id).textContent);
const bench = read("bench");
const { description, digest, panels, chosen, judged, loops } = bench;
const REST = 150; // ms without a move, after which loops and hidden panels are updated: sliders come first
let longest = 20000; // ms that a run may take before its worker is stopped
const parameters = description.parameters.filter(({ used }) => used);
const values = Object.fromEntries(parameters.map(({ name, start }) => [name, start]));
const kept = [];
const place = (id) => document.getElementById(id);
const faults = new Map(); // current faults by place: a field, the link, the run
let run = null, busy = false, wanted = null, resting = 0, slow = 0, late = 0, moved = 0, worker = null;

/** Set or clear the fault of a place; the page shows the latest one. */
function complain(text, where = "") {
  faults.delete(where);
  if (text) faults.set(where, text);
  const latest = [...faults.values()].at(-1) ?? "";
  place("message").textContent = latest;
  place("message").hidden = !latest;
  outdate();
}

/** Mark results that do not belong to the values in the fields. */
function outdate(isLate = false) {
  const isInvalid = [...faults.keys()].some((where) => where.startsWith("field "));
  place("shown").classList.toggle("stale", isInvalid || isLate);
  place("stale").hidden = !(isInvalid && run);
  place("reset").disabled = !isInvalid && Object.keys(changes()).length === 0;
}

/** Hide the results: the current values have none. */
function fail(error) {
  run = null;
  place("shown").hidden = true;
  place("keep").disabled = place("csv").disabled = true;
  place("work").textContent = "no results with these values";
  complain(error, "run");
}

const changes = () =>
  Object.fromEntries(parameters.filter((p) => values[p.name] !== p.start).map((p) => [p.name, values[p.name]]));

function describe() {
  const made = changes(), count = Object.keys(made).length;
  place("changes").textContent = count
    ? `changed: ${Object.entries(made).map(([name, value]) => {
      const parameter = parameters.find((each) => each.name === name);
      return `${name} = ${digits(shownOf(value, parameter))} ${parameter.shownUnit}`.trim();
    }).join(", ")}`
    : "bench values";
  outdate();
  clearTimeout(moved);
  moved = setTimeout(address, REST); // browsers reject more than about ten of these per second
}

function address() {
  const made = changes();
  const isChanged = Object.keys(made).length > 0;
  history.replaceState(null, "", isChanged ? `#${linkOf(digest, made)}` : location.pathname + location.search);
}

/** Return a run's key figure, without a value if the changes affect one of its options. */
function figureOf({ figures, followed }, { name }) {
  const isFollowing = judged.families.some((each) => each.name === "step_response" && each.figures.includes(name));
  if (!followed.length || !isFollowing) return figures[name];
  return { value: NaN, reason: `an option depends on ${followed}. Save the bench file and run it`, open: true };
}

/** Return the cells of a run's key figure: its value, and with a limit the verdict. */
function cellsOf(computed, figure) {
  const { value, reason, open } = computed, met = figure.limit && isMet(computed, figure.limit);
  const outcome = open ? "undecided" : met ? "met" : "missed";
  const mark = { undecided: "?", met: "✓", missed: "✗" }[outcome];
  const text = reason ? "–" : readable(value, figure);
  return { value: element("td", { class: "number", title: reason }, text), outcome, mark, reason };
}

/* Key figures of the run, judged by their limits, next to those of kept runs. */
function judge() {
  place("figures").hidden = !judged;
  place("unjudged").hidden = Boolean(judged);
  if (!judged) return;
  const isStated = judged.figures.some(({ stated }) => stated);
  const heading = (text) => element("th", { scope: "col" }, text);
  const others = kept.map((each) => element("th", { scope: "col", class: "kept", title: each.told }, each.name, dropOf(each)));
  place("figures").tHead.replaceChildren(element("tr", {}, heading("figure"), heading(kept.length ? "this run" : "value"), ...others,
    heading("limit"), ...(isStated ? [heading("stated")] : [])));
  place("figures").tBodies[0].replaceChildren(...judged.figures.map((figure) => {
    const { value, outcome, mark, reason } = cellsOf(figureOf(run, figure), figure);
    const beside = kept.map((each) => {
      const cells = cellsOf(figureOf(each, figure), figure);
      if (figure.limit) cells.value.append(element("span", { class: cells.outcome }, ` ${cells.mark}`));
      return cells.value;
    });
    const verdict = figure.limit ? element("td", { class: outcome, title: reason }, `${mark} ${figure.text}`)
      : element("td", {}, reason);
    const { text, where } = figure.stated ?? { text: "", where: "" };
    const stated = isStated ? [element("td", { title: where }, text)] : [];
    const parts = kept.length ? figure.name.split(/(?<=_)/) : [figure.name]; // leaves room for kept runs
    const name = parts.flatMap((part) => [part, element("wbr", {})]);
    return element("tr", {}, element("th", { scope: "row", title: figure.definition }, ...name), value, ...beside, verdict, ...stated);
  }));
}

/* One run at a time: a new request replaces a waiting one. */
function ask() {
  wanted = { ...values };
  clearTimeout(resting);
  if (busy) return;
  busy = true;
  slow = setTimeout(() => {
    place("work").textContent = "running …";
    outdate(true);
  }, REST);
  place("loops").classList.add("stale"); // they are updated when the sliders rest
  late = setTimeout(giveUp, longest);
  worker.postMessage({ values: wanted });
  wanted = null;
}

function answered({ data: { error, time, table, figures, settled, loops: computed } }) {
  if (computed) {
    if (!busy) place("loops").classList.remove("stale");
    return views.forEach((view, k) => view.draw(computed[k]));
  }
  busy = false;
  clearTimeout(slow);
  clearTimeout(late);
  if (error) fail(error);
  else show({ time, table, figures, settled });
  if (wanted) ask();
}

/** Show a run. */
function show({ time, table, figures, settled }) {
  complain("", "run");
  place("shown").hidden = false;
  const followed = judged ? judged.followed.filter((name) => name in changes()) : [];
  run = { time, signals: columnsOf(table, time, description.signals.map(({ name }) => name)), figures, followed };
  place("work").textContent = settled ? "" : "contacts or friction did not converge in some steps";
  place("keep").disabled = place("csv").disabled = false;
  judge();
  plots.draw(run, kept, values);
  if (loops.length) resting = setTimeout(() => worker.postMessage({ isAboutLoops: true }), REST);
}

/* A figure that cannot be drawn fails shortly after the request: remove it completely. */
addEventListener("error", (event) => {
  event.preventDefault();
  [plots, ...views].forEach((each) => each.forget()); // half of a figure may be drawn
  fail("the results with these values cannot be drawn");
});

/** Stop a run that takes too long. */
function giveUp() {
  worker.terminate();
  busy = false;
  clearTimeout(slow);
  begin();
  fail(`the run with these values took longer than ${longest / 1000} s and was stopped`);
  if (wanted) ask();
}

/** Start the worker that computes in the background. */
function begin() {
  const text = `${read("loader")}\n${read("worker")}`;
  worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
  worker.addEventListener("message", answered);
  worker.addEventListener("error", (event) => fail(`the bench failed to run: ${event.message}`));
  worker.postMessage({ kernel: read("kernel"), given: { description, judged, loops, keep: bench.keep } });
}

function changed(name, value) {
  values[name] = value;
  complain("", "link");
  complain("");
  ask(); // before its description: the worker computes meanwhile
  describe();
}

function save(name, kind, text) {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: kind })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Return a button that drops a kept run. */
function dropOf(each) {
  const drop = element("button", { type: "button", "aria-label": `drop ${each.name}`, title: `drop ${each.name}` }, "×");
  drop.addEventListener("click", () => {
    kept.splice(kept.indexOf(each), 1);
    showKept();
  });
  return drop;
}

function showKept() {
  place("kept").replaceChildren(...kept.map((each) => element("li", {}, `${each.name}: ${each.told}`, dropOf(each))));
  if (!run) return;
  judge();
  plots.draw(run, kept, values);
}

place("keep").addEventListener("click", () => {
  const count = 1 + Math.max(0, ...kept.map(({ name }) => Number(name.split(" ")[1])));
  kept.push({ ...run, name: `run ${count}`, told: place("changes").textContent.replace("changed: ", "") });
  showKept();
});
place("reset").addEventListener("click", () => {
  for (const { name, start } of parameters) rows.get(name).show((values[name] = start)); // invalid fields too
  faults.clear();
  complain("");
  describe();
  ask();
});
place("csv").addEventListener("click", () =>
  save(`${description.name}.csv`, "text/csv", csvOf(run.time, run.signals, description.signals)));
place("toml").addEventListener("click", () =>
  save(`${description.name}.toml`, "application/toml", benchFile(bench.text, changes(), parameters)));
place("link").addEventListener("click", async () => {
  address();
  await navigator.clipboard?.writeText(location.href).catch(() => undefined);
  place("work").textContent = "the address of this page contains its values";
});

function take(link) {
  try {
    const asked = changesOf(link, digest, parameters);
    for (const { name, start } of parameters) rows.get(name).show((values[name] = asked[name] ?? start));
    complain("", "link");
  } catch (error) {
    complain(error.message, "link");
  }
  describe();
}

/* Otherwise a browser leaves the page when a file is dropped on it. */
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  complain("this page cannot open files. Set the values above or with a link. To run a bench file, use bywire run");
});

const rows = parameterPanel(place("parameters"), parameters, bench.units, chosen, changed, complain);
const plots = curves(place("curves"), panels);
const views = loops.map((loop) => bodeView(place("loops"), loop));
const again = () => {
  if (run) plots.draw(run, kept, values);
  views.forEach((view) => view.draw());
};
new ResizeObserver(again).observe(place("curves"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const each of [plots, ...views]) each.forget();
  again();
});
if (typeof WebAssembly === "undefined" || typeof Worker === "undefined") {
  complain("this browser cannot run WebAssembly in workers, which the bench needs. Use a current browser");
} else {
  begin();
  take(location.hash.slice(1));
  ask();
  addEventListener("hashchange", () => {
    take(location.hash.slice(1));
    ask();
  });
}
