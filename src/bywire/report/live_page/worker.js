/* Runs and judges the bench beside the page, which stays alive meanwhile; the scripts that it calls stand above. */
let loaded; // promised with the first message: the next ones may come before it is there
let bench;
self.onmessage = async ({ data: { kernel, given, values, isAboutLoops } }) => {
  try {
    bench ??= given;
    loaded ??= unpacked(kernel).then((bytes) => load(bytes, bench.description));
    const brake = await loaded;
    if (isAboutLoops) // with the parameters of the last run, which still stand in the module
      self.postMessage({ loops: bench.loops.map((loop) => loopAt(brake.exports, loop)) });
    if (!values) return;
    const made = brake.run(values), { description, keep, judged } = bench;
    const recording = recordingOf(made, description.settle, keep), { time, table } = recording;
    const names = description.signals.map(({ name }) => name);
    const figures = judged && keyFigures(brake.exports, recording, names, judged.families);
    // given away: no copy
    self.postMessage({ time, table, figures, settled: made.settled }, [time.buffer, table.buffer]);
  } catch (error) {
    self.postMessage({ error: error.message });
  }
};
