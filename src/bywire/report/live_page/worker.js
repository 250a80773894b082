/* Runs the bench beside the page, which stays alive meanwhile; the loader stands above. */
let loaded; // promised with the first message: the next ones may come before it is there
self.onmessage = async ({ data: { bytes, description, values, number } }) => {
  try {
    loaded ??= load(bytes, description);
    const brake = await loaded;
    if (values) self.postMessage({ number, ...brake.run(values) });
  } catch (error) {
    self.postMessage({ number, error: error.message });
  }
};
