/* Runs and judges the bench in the background, so the page remains responsive. The scripts that it calls are above. */
const LOST = "the bench cannot be computed with these values: a state becomes infinite or is not a number";
/** Return a loop's response and margins, or the reason for their absence. */
function loopOf(exported, loop) {
  try {
    return loopAt(exported, loop);
  } catch {
    return { reason: "this loop cannot be computed with these values" };
  }
}
let loaded; // a promise from the first message: more messages may come before it is fulfilled
let bench;
self.onmessage = async ({ data: { kernel, given, values, isAboutLoops } }) => {
  try {
    bench ??= given;
    loaded ??= unpacked(kernel).then((bytes) => load(bytes, bench.description));
    const brake = await loaded;
    if (isAboutLoops) // with the parameters of the last run, which are still in the module
      self.postMessage({ loops: bench.loops.map((loop) => loopOf(brake.exports, loop)) });
    if (!values) return;
    const made = brake.run(values), { description, keep, judged } = bench;
    const recording = recordingOf(made, description.settle, keep), { time, table } = recording;
    if (!table.every(Number.isFinite)) throw new RangeError(LOST);
    const names = description.signals.map(({ name }) => name);
    const figures = judged && keyFigures(brake.exports, recording, names, judged.families);
    // given away: no copy
    self.postMessage({ time, table, figures, settled: made.settled }, [time.buffer, table.buffer]);
  } catch (error) {
    self.postMessage({ error: error instanceof RangeError ? error.message : LOST });
  }
};
