// node drive.mjs FOLDER NAME TASK.json: runs a module as the task says, and writes its rows.
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
const [folder, name, task] = process.argv.slice(2);
const { load } = await import(pathToFileURL(`${folder}/bywire.mjs`));
const description = JSON.parse(readFileSync(`${folder}/${name}.json`));
const bytes = readFileSync(`${folder}/${name}.wasm`);
const brake = await load(bytes, description);
const { parameters, stimulus, duration, repeat } = JSON.parse(readFileSync(task));
const given = {};
for (const [key, course] of Object.entries(stimulus ?? {})) given[key] = Float64Array.from(course);
try {
  let made = brake.run(parameters, { stimulus: given, duration });
  const begun = process.cpuUsage();
  for (let k = 0; k < (repeat ?? 1); ++k) made = brake.run(parameters, { stimulus: given, duration });
  const { user, system } = process.cpuUsage(begun);
  const seconds = (user + system) / 1e6 / (repeat ?? 1);
  const rows = Object.values(made.signals);
  const table = new Float64Array(rows.length * made.time.length);
  rows.forEach((row, k) => table.set(row, k * made.time.length));
  writeFileSync(`${task}.bin`, new Uint8Array(table.buffer));
  const { imports } = WebAssembly.Module;
  console.log(JSON.stringify({ names: Object.keys(made.signals), rows: made.time.length,
    settled: made.settled, seconds, imports: imports(new WebAssembly.Module(bytes)) }));
} catch (error) {
  console.log(JSON.stringify({ error: `${error.name}: ${error.message}` }));
}
