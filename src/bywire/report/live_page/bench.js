/* The page: values of parameters in, curves out, the latest value first. */

const read = (id) => JSON.parse(document.getElementById(id).textContent);
const bench = read("bench");
const { description, digest, panels, chosen, judged, loops } = bench;
const REST = 150; // ms without a move, after which loops and what is out of sight follow: sliders come first
let longest = 20000; // ms that a run may take: then it is given up, and its worker with it
const parameters = description.parameters.filter(({ used }) => used);
const values = Object.fromEntries(parameters.map(({ name, start }) => [name, start]));
const kept = [];
const place = (id) => document.getElementById(id);
const faults = new Map(); // what is wrong now, by where: a field, the link, the run
let run = null, busy = false, wanted = null, resting = 0, slow = 0, late = 0, moved = 0, worker = null;

/** Say what is wrong, or that nothing is any more, somewhere; the latest fault is shown. */
function complain(text, where = "") {
  faults.delete(where);
  if (text) faults.set(where, text);
  const latest = [...faults.values()].at(-1) ?? "";
  place("message").textContent = latest;
  place("message").hidden = !latest;
  outdate();
}

/** Mark results that are not those of what stands in the fields. */
function outdate(isLate = false) {
  const isInvalid = [...faults.keys()].some((where) => where.startsWith("field "));
  place("shown").classList.toggle("stale", isInvalid || isLate);
  place("stale").hidden = !(isInvalid && run);
  place("reset").disabled = !isInvalid && Object.keys(changes()).length === 0;
}

/** Take away the results where there are none of these values. */
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
    : "as in the bench";
  outdate();
  clearTimeout(moved);
  moved = setTimeout(address, REST); // browsers refuse more than some ten of these a second
}

function address() {
  const made = changes();
  const isChanged = Object.keys(made).length > 0;
  history.replaceState(null, "", isChanged ? `#${linkOf(digest, made)}` : location.pathname + location.search);
}

/* Key figures beside those of the runs that were kept, and whether they are as required. */
function judge() {
  place("figures").hidden = !judged;
  place("unjudged").hidden = Boolean(judged);
  if (!judged) return;
  const following = judged.families.find(({ name }) => name === "step_response")?.figures ?? [];
  const followed = judged.followed.filter((name) => name in changes());
  const isStated = judged.figures.some(({ stated }) => stated);
  place("stated").hidden = !isStated;
  place("figures").tBodies[0].replaceChildren(...judged.figures.map((figure) => {
    const computed = followed.length && following.includes(figure.name)
      ? { value: NaN, reason: `an option follows ${followed}: save the bench file and run it`, open: true }
      : run.figures[figure.name];
    const value = computed.reason ? element("td", { class: "number", title: computed.reason }, "–")
      : element("td", { class: "number" }, readable(shownOf(computed.value, figure), figure.unit));
    const met = figure.limit && isMet(computed, figure.limit);
    const outcome = computed.open ? "undecided" : met ? "met" : "missed";
    const mark = { undecided: "?", met: "✓", missed: "✗" }[outcome];
    const verdict = figure.limit
      ? element("td", { class: outcome, title: computed.reason }, `${mark} ${figure.text}`)
      : element("td", {}, computed.reason);
    const { text, where } = figure.stated ?? { text: "", where: "" };
    const stated = isStated ? [element("td", { title: where }, text)] : [];
    return element("tr", {}, element("th", { scope: "row", title: figure.definition }, figure.name), value, verdict, ...stated);
  }));
}

/* One run at a time: what was asked for meanwhile replaces what waited. */
function ask() {
  wanted = { ...values };
  clearTimeout(resting);
  if (busy) return;
  busy = true;
  slow = setTimeout(() => {
    place("work").textContent = "running …";
    outdate(true);
  }, REST);
  place("loops").classList.add("stale"); // they follow when the sliders rest
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
  run = { time, signals: columnsOf(table, time, description.signals.map(({ name }) => name)), figures };
  place("work").textContent = settled ? "" : "contacts or frictions did not settle in some step";
  place("keep").disabled = place("csv").disabled = false;
  judge();
  plots.draw(run, kept, values);
  if (loops.length) resting = setTimeout(() => worker.postMessage({ isAboutLoops: true }), REST);
}

/* A figure that cannot be drawn fails a moment after it was asked for: nothing of it may stay. */
addEventListener("error", (event) => {
  event.preventDefault();
  [plots, ...views].forEach((each) => each.forget()); // half of a figure may stand
  fail("the results with these values cannot be drawn");
});

/** Give a run up that takes too long. */
function giveUp() {
  worker.terminate();
  busy = false;
  clearTimeout(slow);
  begin();
  fail(`the run with these values takes longer than ${longest / 1000} s and was given up`);
  if (wanted) ask();
}

/** Start the worker that computes beside the page. */
function begin() {
  const text = `${read("loader")}\n${read("worker")}`;
  worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
  worker.addEventListener("message", answered);
  worker.addEventListener("error", (event) => fail(`the bench does not run: ${event.message}`));
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

function showKept() {
  place("kept").replaceChildren(...kept.map((each, k) => {
    const drop = element("button", { type: "button", "aria-label": `drop ${each.name}` }, "×");
    drop.addEventListener("click", () => {
      kept.splice(k, 1);
      showKept();
      if (run) plots.draw(run, kept, values);
    });
    return element("li", { title: each.told }, each.name, drop);
  }));
}

place("keep").addEventListener("click", () => {
  const count = 1 + Math.max(0, ...kept.map(({ name }) => Number(name.split(" ")[1])));
  kept.push({ ...run, name: `run ${count}`, told: place("changes").textContent });
  showKept();
  plots.draw(run, kept, values);
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
  place("work").textContent = "the address of this page holds its values";
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

/* Without this a browser leaves the page for a file that is dropped on it, however large it is. */
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  complain("the page takes no files: its values are set above, or by its link; bywire run takes bench files");
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
  complain("this browser runs no WebAssembly in workers, by which the bench is computed: take a current one");
} else {
  begin();
  take(location.hash.slice(1));
  ask();
  addEventListener("hashchange", () => {
    take(location.hash.slice(1));
    ask();
  });
}
