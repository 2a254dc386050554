// Buttons of the gallery: a scene in rerun's viewer in place of its picture, one at a time, loaded when asked for.
"use strict";

const viewer = new URL("viewer/index.html", document.currentScript.src);

function play(button) {
  for (const other of document.querySelectorAll("p.player.playing button")) stop(other);
  const place = button.parentElement;
  if (location.protocol === "file:") {
    place.append(" Browsers play scenes of a site that is served: python -m http.server in its folder.");
    button.disabled = true;
    return;
  }
  const address = new URL(viewer);
  address.searchParams.set("url", new URL(button.dataset.recording, location).pathname);
  const frame = document.createElement("iframe");
  frame.src = address;
  frame.title = "The scene in rerun's viewer";
  frame.allowFullscreen = true;
  const alone = document.createElement("a");
  alone.href = address;
  alone.target = "_blank";
  alone.textContent = "in a window of its own";
  place.before(frame);
  place.append(" ", alone);
  place.previousElementSibling.previousElementSibling.hidden = true;
  place.classList.add("playing");
  button.textContent = "Back to the picture";
}

function stop(button) {
  const place = button.parentElement;
  place.previousElementSibling.remove();
  place.previousElementSibling.hidden = false;
  place.querySelector("a").remove();
  place.classList.remove("playing");
  button.textContent = "Play in the browser";
}

document.addEventListener("DOMContentLoaded", () => {
  for (const button of document.querySelectorAll("p.player button")) {
    button.addEventListener("click", () => {
      if (button.parentElement.classList.contains("playing")) stop(button);
      else play(button);
    });
  }
});
