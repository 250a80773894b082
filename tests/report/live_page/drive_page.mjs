// node drive_page.mjs PAGE SCRIPTS TASK.json: what a page computes and says, without a browser.
import { readFileSync, writeFileSync } from "node:fs";
import { runInThisContext } from "node:vm";
const [page, scripts, task] = process.argv.slice(2);
const text = readFileSync(page, "utf8");
const block = (id) => JSON.parse(text.match(new RegExp(`id="${id}">(.*?)</script>`, "s"))[1]);
for (const name of ["values.js", "unpack.js", "figures.js", "loops.js", "margins.js", "curves.js"]) runInThisContext(readFileSync(`${scripts}/${name}`, "utf8"));
runInThisContext(block("loader"));
const { description, digest, judged, keep, loops, units, text: file } = block("bench");
const parameters = description.parameters.filter(({ used }) => used);
const brake = await runInThisContext("load")(await runInThisContext("unpacked")(block("kernel")), description);
const call = (name, ...given) => runInThisContext(name)(...given);
const tries = {
  run({ changes }) {
    const made = call("recordingOf", brake.run(changes), description.settle, keep);
    const names = description.signals.map(({ name }) => name), columns = call("columnsOf", made.table, made.time, names);
    const signals = Object.fromEntries(Object.entries(columns).map(([n, c]) => [n, Array.from(c)]));
    const figures = judged && call("keyFigures", brake.exports, made, names, judged.families);
    return { time: Array.from(made.time), signals, figures };
  },
  loops({ changes }) {
    brake.run(changes);
    return loops.map((loop) => call("loopAt", brake.exports, loop));
  },
  quantities({ texts }) {
    return parameters.map((parameter) => texts.map((text) => call("quantityOf", text, parameter, units)));
  },
  link: ({ changes }) => call("changesOf", call("linkOf", digest, changes), digest, parameters),
  hostile: ({ link }) => call("changesOf", link.replace("DIGEST", digest), digest, parameters),
  file: ({ changes }) => call("benchFile", file, changes, parameters),
  bends: ({ x, y, off }) => call("bendsOf", (k) => x[k], (k) => y[k], 0, x.length - 1, off),
  slider: ({ name, share }) => {
    const parameter = parameters.find((each) => each.name === name), way = call("sliderOf", parameter);
    return { ...way, value: call("valueAt", way, share), share: call("shareOf", way, parameter.start) };
  },
};
const answers = JSON.parse(readFileSync(task)).map(({ kind, ...given }) => {
  try {
    return { answer: tries[kind](given) };
  } catch (error) {
    return { error: error.message };
  }
});
writeFileSync(`${task}.out`, JSON.stringify(answers, (_, x) => (typeof x === "number" && !Number.isFinite(x) ? String(x) : x)));
