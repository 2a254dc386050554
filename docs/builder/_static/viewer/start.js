// Starts rerun's viewer on the recording that the page's address names: index.html?url=../../scenes/NAME.rrd
"use strict";

const told = document.getElementById("told");
const canvas = document.getElementById("canvas");

function tell(words) {
  canvas.classList.remove("running");
  told.textContent = words;
}

async function program() {
  const answer = await fetch("re_viewer_wasm.bin");
  if (!answer.ok) throw new Error(`re_viewer_wasm.bin: ${answer.status}`);
  const total = Number(answer.headers.get("content-length"));
  let loaded = 0;
  const counted = new TransformStream({
    transform(piece, out) {
      loaded += piece.byteLength;
      const share = total ? `${Math.round((100 * loaded) / total)} %` : `${(loaded / 1e6).toFixed(0)} MB`;
      tell(`The viewer is being loaded: ${share}`);
      out.enqueue(piece);
    },
  });
  const unpacked = answer.body.pipeThrough(counted).pipeThrough(new DecompressionStream("gzip"));
  return new Response(unpacked, { headers: { "content-type": "application/wasm" } });
}

async function start() {
  const asked = new URLSearchParams(location.search).get("url");
  await wasm_bindgen({ module_or_path: program() });
  const handle = new wasm_bindgen.WebHandle({
    url: [new URL(asked, location).href],
    hide_welcome_screen: true,
    enable_history: false,
    notebook: false,
    persist: false,
    theme: "dark", // which the recording's colours are made for
    render_backend: new URLSearchParams(location.search).get("renderer"),
  });
  await handle.start(canvas);
  canvas.classList.add("running");
  setInterval(() => {
    if (handle.has_panicked()) tell(`The viewer has ended: ${handle.panic_message()}`);
  }, 1000);
}

start().catch((error) => tell(`The viewer can't be started here: ${error}`));
