"use strict";

function connectViewer(viewer) {
  const panels = [...viewer.querySelectorAll(".panels")];
  const frame = viewer.querySelector("[name=frame]");
  const blend = viewer.querySelector("[name=blend]");
  const named = viewer.querySelector("output");
  const coordinates = [...viewer.querySelectorAll("[type=radio]")];

  function show() {
    const index = frame ? frame.value : "0";
    const coordinate = coordinates.find((c) => c.checked).value;
    for (const panel of panels) {
      panel.hidden = panel.dataset.frame !== index || panel.dataset.coordinate !== coordinate;
      if (!panel.hidden && named) named.textContent = panel.dataset.name;
    }
    viewer.style.setProperty("--blend", blend.value / 100);
  }
  viewer.addEventListener("input", show);
  show();
}

document.querySelectorAll(".viewer").forEach(connectViewer);
window.addEventListener("beforeprint", () => {
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
});
