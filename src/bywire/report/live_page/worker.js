/* Runs and judges the bench beside the page, which stays alive meanwhile; the scripts that it calls stand above. */
let loaded; // promised with the first message: the next ones may come before it is there
let bench;
self.onmessage = async ({ data: { kernel, given, values, number, isAboutLoops } }) => {
  try {
    bench ??= given;
    loaded ??= unpacked(kernel).then((bytes) => load(bytes, bench.description));
    const brake = await loaded;
    if (isAboutLoops) // with the parameters of the last run, which still stand in the module
      self.postMessage({ loops: bench.loops.map((loop) => loopAt(brake.exports, loop)) });
    if (!values) return;
    const { settled, ...made } = brake.run(values);
    const { time, signals } = recordingOf(made, bench.description.settle, bench.keep);
    const figures = bench.judged && keyFigures(brake.exports, time, signals, bench.judged.families);
    const buffers = [time, ...Object.values(signals)].map(({ buffer }) => buffer);
    self.postMessage({ number, time, signals, figures, settled }, buffers); // given away: no copy
  } catch (error) {
    self.postMessage({ number, error: error.message });
  }
};
