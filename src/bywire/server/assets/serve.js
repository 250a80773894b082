/* Forms start jobs, dropped files become measurements, and the list of jobs updates. */
"use strict";

const place = (id) => document.getElementById(id);
const states = new Map();
let pause = 0, reports = 0, shownSoFar = "[]";

function complain(text) {
  place("message").textContent = text;
  place("message").hidden = !text;
  if (text) place("message").scrollIntoView({ block: "nearest" });
}

async function ask(address, method = "GET", body = undefined) {
  const headers = body === undefined ? {} : { "Content-Type": "application/json" };
  let answer;
  try {
    answer = await fetch(address, { method, headers, body: body && JSON.stringify(body) });
  } catch {
    throw new Error("the server does not reply. If it has stopped, start 'bywire serve' again");
  }
  const said = await answer.json().catch(() => ({ error: `status ${answer.status}` }));
  if (!answer.ok) throw Object.assign(new Error(said.error), { field: said.field });
  return said;
}

const element = (name, text = "", attributes = {}) =>
  Object.assign(document.createElement(name), { textContent: text }, attributes);

/* Forms */

function valueOf(field) {
  if (field.type === "checkbox") return field.checked;
  if (field.multiple) return [...field.selectedOptions].map(({ value }) => value).join("\n");
  return field.value;
}

/* Show an error at its field, and focus the field. Errors without a visible field are at the top. */
function complainOf(form, { message, field: name }) {
  const field = name && form.querySelector(`:is(input:not([type=hidden]), select, textarea)[name="${CSS.escape(name)}"]`);
  if (!field) return complain(message);
  const said = element("p", message, { className: "wrong", id: `${field.id}-wrong` });
  field.closest(".field").append(said);
  field.setAttribute("aria-invalid", "true");
  field.setAttribute("aria-describedby", [field.dataset.hint, said.id].filter(Boolean).join(" "));
  const folded = field.closest("details");
  if (folded) folded.open = true;
  field.focus();
}

function forgive(field) {
  if (field.getAttribute("aria-invalid") !== "true") return;
  place(`${field.id}-wrong`).remove();
  field.removeAttribute("aria-invalid");
  if (field.dataset.hint) field.setAttribute("aria-describedby", field.dataset.hint);
  else field.removeAttribute("aria-describedby");
}

async function begin(event) {
  event.preventDefault();
  const form = event.target, fields = [...form.elements].filter(({ name }) => name);
  if (form.getAttribute("aria-busy") === "true") return;
  const asked = Object.fromEntries(fields.map((field) => [field.name, valueOf(field)]));
  form.setAttribute("aria-busy", "true"); // a disabled button would lose the focus
  fields.forEach(forgive);
  complain("");
  try {
    await ask("/api/jobs", "POST", { task: form.dataset.task, form: asked });
    await refresh();
    place("jobs-title").scrollIntoView({ block: "nearest" });
  } catch (error) {
    complainOf(form, error);
  }
  form.removeAttribute("aria-busy");
}

function armForm(form) {
  form.addEventListener("submit", begin);
  form.addEventListener("input", ({ target }) => forgive(target));
  for (const field of form.elements) field.dataset.hint = field.getAttribute("aria-describedby") ?? "";
  form.querySelector("button[type=submit]").disabled = false;
}

/* Measurement files */

function sent(file, bar) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", `/api/measurements/${encodeURIComponent(file.name)}`);
    request.upload.onprogress = ({ loaded, total }) => { bar.value = total ? loaded / total : 0; };
    request.onerror = () => reject(new Error(`${file.name} could not be sent. The server may have stopped`));
    request.onload = () => {
      let said = {};
      try { said = JSON.parse(request.responseText); } catch { /* the status is the error */ }
      if (request.status === 201) resolve(said.file);
      else reject(new Error(said.error ?? `status ${request.status}`));
    };
    request.send(file);
  });
}

async function take(drop, file) {
  const most = Number(document.body.dataset.largest), bar = drop.querySelector(".sent");
  if (file.size > most) {
    complain(`${file.name} is ${Math.ceil(file.size / 1e6)} MB, but the limit is ${Math.floor(most / 1e6)} MB. Copy `
      + "it to the served folder, or make it smaller with 'bywire convert'");
    return;
  }
  bar.hidden = false;
  try {
    const name = await sent(file, bar), select = drop.querySelector("select");
    select.append(element("option", name, { value: name, selected: true }));
    select.dispatchEvent(new Event("change", { bubbles: true }));
    complain("");
    place("spoken").textContent = `${name} is uploaded`;
  } catch (error) {
    complain(error.message);
  }
  bar.hidden = true;
}

function arm(drop) {
  const upload = drop.querySelector(".upload");
  upload.addEventListener("change", async () => {
    for (const file of upload.files) await take(drop, file);
    upload.value = "";
  });
  for (const kind of ["dragenter", "dragover"]) {
    drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.add("over"); });
  }
  drop.addEventListener("dragleave", () => drop.classList.remove("over"));
  drop.addEventListener("drop", async (event) => {
    event.preventDefault();
    drop.classList.remove("over");
    for (const file of event.dataTransfer.files) await take(drop, file);
  });
}

/* Jobs */

const isActive = ({ state }) => state === "waiting" || state === "running";

function outcome(job) {
  if (job.state === "done" && job.holds === false) return "done, but not all requirements are met";
  return job.state;
}

const linkTo = (path, text) =>
  element("a", text, { href: `/${path.split("/").map(encodeURIComponent).join("/")}` });

function shown(job) {
  const item = element("li"), tools = element("p", "", { className: "tools" });
  item.dataset.number = job.number;
  item.className = job.state === "done" ? (job.holds === false ? "missed" : "held") : job.state;
  item.append(element("p", `${job.title}: ${job.subject} (${outcome(job)})`));
  if (job.headline && job.headline !== job.state) item.append(element("p", job.headline));
  if (job.message) item.append(element("p", job.message));
  if (job.said.length) {
    const details = element("details");
    details.append(element("summary", job.said.length === 1 ? "1 remark" : `${job.said.length} remarks`));
    details.append(...job.said.map((text) => element("p", text)));
    item.append(details);
  }
  if (isActive(job)) {
    const bar = element("progress", "", { max: 1 });
    if (job.share > 0) bar.value = job.share;
    bar.setAttribute("aria-label", `progress of job ${job.number}`);
    item.append(bar, element("p", job.label));
    const button = element("button", "cancel", { type: "button" });
    button.setAttribute("aria-label", `cancel ${job.title} of ${job.subject}`);
    button.addEventListener("click", () => cancel(job, button));
    tools.append(button);
  }
  if (job.report) {
    const link = linkTo(`file/${job.report}`, "report");
    link.setAttribute("aria-label", `report of ${job.title}, ${job.subject}`);
    tools.append(link);
  }
  if (tools.children.length) item.append(tools);
  return item;
}

async function cancel(job, button) {
  if (button.getAttribute("aria-disabled") === "true") return;
  button.setAttribute("aria-disabled", "true"); // a disabled button would lose the focus
  try {
    await ask(`/api/jobs/${job.number}/cancel`, "POST", {});
  } catch (error) {
    complain(error.message);
  }
  await refresh();
}

/* Keep the focus when an item is rebuilt, on the element with the same label or on the item itself. */
function replace(old, item) {
  const here = old.contains(document.activeElement) && document.activeElement;
  const name = here && here.getAttribute("aria-label");
  old.replaceWith(item);
  if (!here) return;
  const same = name && [...item.querySelectorAll("[aria-label]")].find((each) => each.getAttribute("aria-label") === name);
  item.tabIndex = -1;
  (same || item.querySelector("a") || item).focus({ preventScroll: true });
}

function update(job) {
  const said = JSON.stringify(job), old = place("jobs").querySelector(`[data-number="${job.number}"]`);
  if (states.get(job.number)?.said === said && old) return old;
  const known = states.get(job.number);
  const item = old && known && isActive(job) && known.state === job.state && known.report === job.report ? old : shown(job);
  if (item === old) {
    const bar = item.querySelector("progress");
    if (job.share > 0) bar.value = job.share;
    bar.nextElementSibling.textContent = job.label;
  } else if (known && known.state !== job.state && !isActive(job)) {
    place("spoken").textContent = `${job.title} of ${job.subject}: ${outcome(job)}`;
  }
  states.set(job.number, { said, state: job.state, report: job.report });
  if (old && item !== old) replace(old, item);
  return item;
}

const NS = "http://www.w3.org/2000/svg";

/* Bars of a histogram, with their text next to them. */
function bars({ counts, ends }) {
  const drawn = document.createElementNS(NS, "svg"), most = Math.max(...counts);
  const set = (node, values) => Object.entries(values).forEach(([name, value]) => node.setAttribute(name, value));
  set(drawn, { viewBox: `0 0 ${counts.length} 100`, preserveAspectRatio: "none", role: "img", "aria-label": `histogram from ${ends[0]} to ${ends[1]}` });
  counts.forEach((count, k) => {
    const bar = document.createElementNS(NS, "rect"), height = 100 * count / most;
    set(bar, { x: k + 0.05, y: 100 - height, width: 0.9, height });
    drawn.append(bar);
  });
  return drawn;
}

function showSoFar(rows) {
  const said = JSON.stringify(rows);
  if (said === shownSoFar) return;
  shownSoFar = said;
  place("study-so-far").replaceChildren(...rows.map((row) => {
    const item = element("li");
    item.append(element("p", row.text));
    if (row.counts.length) {
      const ends = element("p", "", { className: "ends" });
      ends.append(...row.ends.map((end) => element("span", end)));
      item.append(bars(row), ends);
    }
    return item;
  }));
}

function showStudy(jobs) {
  const frame = place("study-report"), study = document.querySelector('[data-task="study"] [name="study"]');
  const job = jobs.find((each) => each.task === "study" && each.subject === study?.value);
  if (!frame || !job) return;
  showSoFar(job.so_far);
  if (job.label) place("study-progress").textContent = `${job.label}: ${Math.round(100 * job.share)} %, ${job.state}`;
  const count = job.reports + (job.state === "done" && job.report ? 1 : 0);
  if (count !== reports) {
    reports = count;
    frame.hidden = false;
    frame.src = frame.dataset.address;
  }
}

async function refresh() {
  clearTimeout(pause);
  let jobs = [];
  try {
    jobs = (await ask("/api/jobs")).jobs;
    const items = jobs.map(update), list = place("jobs");
    // One at a time, because a moved item loses the focus. The latest are first, and the oldest are removed.
    items.forEach((item, k) => { if (list.children[k] !== item) list.insertBefore(item, list.children[k] ?? null); });
    while (list.children.length > items.length) list.lastElementChild.remove();
    place("no-jobs").hidden = jobs.length > 0;
    showStudy(jobs);
  } catch (error) {
    complain(error.message);
  }
  pause = setTimeout(refresh, jobs.some(isActive) ? 500 : 4000);
}

document.querySelectorAll("form.task").forEach(armForm);
document.querySelectorAll(".drop").forEach(arm);
document.querySelectorAll("form.task").forEach(armColumns);
// A file dropped elsewhere must not replace the page.
for (const kind of ["dragover", "drop"]) addEventListener(kind, (event) => event.preventDefault());
place("live-case")?.addEventListener("change", ({ target }) => {
  const address = `${target.dataset.address}&case=${encodeURIComponent(target.value)}`;
  place("live").src = address;
  place("live-link").href = address;
});
refresh();
