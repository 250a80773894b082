/* The kernel is in the page, deflated and in base 64, which saves a quarter of the bytes. */

/** Return the bytes of a module. */
async function unpacked(text) {
  if (typeof DecompressionStream === "undefined")
    throw new Error("this browser cannot unpack the module that runs the bench. Use a current browser");
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}
