"use strict";
// Helpers of the page, each of which the page does without: turn the robot, zoom a picture, copy a text, open a window.
(function () {
  function button(text, label, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.setAttribute("aria-label", label);
    made.title = label;
    made.addEventListener("click", act);
    return made;
  }

  function bar(...buttons) {
    const made = document.createElement("div");
    made.className = "tools";
    made.append(...buttons);
    return made;
  }

  // The robot: orthographic, turned by dragging or by the arrow keys, scaled by + and -.
  function solid(place) {
    const scene = JSON.parse(place.dataset.solid);
    const canvas = document.createElement("canvas");
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The robot; drag or use the arrow keys to turn it");
    const first = { azimuth: -62 * Math.PI / 180, elevation: 24 * Math.PI / 180, scale: 1 };
    let eye = { ...first };
    let shown = -1;
    const points = scene.anchors.concat(...scene.windows.map((w) => (w.held || []).concat(w.path.filter((p) => p))));
    const low = [0, 1, 2].map((k) => Math.min(...points.map((p) => p[k])));
    const high = [0, 1, 2].map((k) => Math.max(...points.map((p) => p[k])));
    const middle = low.map((value, k) => (value + high[k]) / 2);
    const reach = Math.hypot(...low.map((value, k) => high[k] - value)) / 2 || 1;

    function draw() {
      const width = canvas.clientWidth, height = canvas.clientHeight, dense = window.devicePixelRatio || 1;
      if (!width || !height) return;
      canvas.width = Math.round(width * dense);
      canvas.height = Math.round(height * dense);
      const pen = canvas.getContext("2d");
      pen.scale(dense, dense);
      const size = 0.47 * Math.min(width, height) / reach * eye.scale;
      const [ca, sa, ce, se] = [Math.cos(eye.azimuth), Math.sin(eye.azimuth), Math.cos(eye.elevation), Math.sin(eye.elevation)];
      const seen = (p) => {
        const [x, y, z] = p.map((value, k) => value - middle[k]);
        return [width / 2 + size * (-sa * x + ca * y), height / 2 - size * (-se * (ca * x + sa * y) + ce * z)];
      };
      const line = (from, to) => { pen.beginPath(); pen.moveTo(...seen(from)); pen.lineTo(...seen(to)); pen.stroke(); };
      axes(pen, seen, line);
      scene.windows.forEach((w, index) => {
        if (!w.held || (shown >= 0 && shown !== index)) return;
        pen.strokeStyle = "#888888"; pen.lineWidth = shown === index ? 1.4 : 0.6;
        w.held.forEach((a, cable) => line(scene.anchors[cable], a));
        pen.beginPath();
        w.held.forEach((a, k) => (k ? pen.lineTo(...seen(a)) : pen.moveTo(...seen(a))));
        pen.closePath();
        pen.fillStyle = shown === index ? "rgba(0,114,178,0.35)" : "rgba(0,114,178,0.14)"; pen.fill();
        pen.strokeStyle = "#0072B2"; pen.stroke();
      });
      scene.windows.forEach((w, index) => {
        if (shown >= 0 && shown !== index) return;
        pen.strokeStyle = "#D55E00"; pen.lineWidth = 1.1; pen.beginPath();
        let on = false;
        w.path.forEach((p) => { if (!p) { on = false; } else { on ? pen.lineTo(...seen(p)) : pen.moveTo(...seen(p)); on = true; } });
        pen.stroke();
      });
      pen.strokeStyle = "#009E73"; pen.lineWidth = 1.2;
      scene.arrows.forEach(([from, to]) => line(from, to));
      pen.fillStyle = "#000000"; pen.font = "bold 13px sans-serif";
      scene.anchors.forEach((p, k) => {
        const [x, y] = seen(p);
        pen.fillRect(x - 4, y - 4, 8, 8);
        pen.fillText(String(k + 1), x + 7, y - 6);
      });
    }

    function axes(pen, seen, line) {
      pen.fillStyle = "#57606a"; pen.strokeStyle = "#57606a"; pen.lineWidth = 1; pen.font = "12px sans-serif";
      ["x", "y", "z"].forEach((name, k) => {
        const tip = low.slice();
        tip[k] += 0.25 * reach;
        line(low, tip);
        pen.fillText(name, ...seen(tip));
      });
    }

    const turn = (azimuth, elevation) => {
      eye.azimuth += azimuth;
      eye.elevation = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, eye.elevation + elevation));
      draw();
    };
    const scale = (factor) => { eye.scale = Math.max(0.3, Math.min(20, eye.scale * factor)); draw(); };
    let held = null;
    canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      turn(-(event.clientX - held[0]) / 150, (event.clientY - held[1]) / 150);
      held = [event.clientX, event.clientY];
    });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointercancel", () => { held = null; });
    canvas.addEventListener("keydown", (event) => {
      const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
      if (keys[event.key]) { turn(...keys[event.key]); event.preventDefault(); }
      if (event.key === "+") scale(1.25);
      if (event.key === "-") scale(0.8);
    });
    const pick = document.createElement("select");
    pick.setAttribute("aria-label", "Which window is shown");
    ["all windows", ...scene.windows.map((w) => w.id)].forEach((name, k) => {
      const option = document.createElement("option");
      option.value = String(k - 1);
      option.textContent = name;
      pick.append(option);
    });
    pick.addEventListener("change", () => { shown = Number(pick.value); draw(); });
    const tools = bar(
      button("+", "Larger", () => scale(1.25)),
      button("−", "Smaller", () => scale(0.8)),
      button("⟲", "As at first", () => { eye = { ...first }; draw(); }),
    );
    tools.append(pick);
    place.append(canvas, tools);
    place.classList.add("alive");
    if ("ResizeObserver" in window) new ResizeObserver(draw).observe(canvas);
    draw();
  }

  // A picture: drag a rectangle to see it larger; double click, or the button, for the whole.
  function zoom(card) {
    const svg = card.querySelector("svg");
    if (!svg || !svg.viewBox.baseVal) return;
    const whole = svg.getAttribute("viewBox");
    const now = () => svg.viewBox.baseVal;
    const set = (x, y, width, height) => svg.setAttribute("viewBox", [x, y, width, height].join(" "));
    const about = (factor) => {
      const box = now();
      const [width, height] = [box.width * factor, box.height * factor];
      if (factor > 1 && width >= Number(whole.split(" ")[2])) { svg.setAttribute("viewBox", whole); return; }
      set(box.x + (box.width - width) / 2, box.y + (box.height - height) / 2, width, height);
    };
    const at = (event) => {
      const spot = new DOMPoint(event.clientX, event.clientY);
      return spot.matrixTransform(svg.getScreenCTM().inverse());
    };
    let from = null, mark = null;
    svg.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch") return;
      from = at(event);
      mark = document.createElementNS(svg.namespaceURI, "rect");
      mark.setAttribute("class", "mark");
      svg.append(mark);
      svg.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    svg.addEventListener("pointermove", (event) => {
      if (!from) return;
      const to = at(event);
      mark.setAttribute("x", Math.min(from.x, to.x)); mark.setAttribute("y", Math.min(from.y, to.y));
      mark.setAttribute("width", Math.abs(to.x - from.x)); mark.setAttribute("height", Math.abs(to.y - from.y));
    });
    const end = (event) => {
      if (!from) return;
      const to = at(event);
      const [width, height] = [Math.abs(to.x - from.x), Math.abs(to.y - from.y)];
      mark.remove();
      if (width > 4 && height > 4) set(Math.min(from.x, to.x), Math.min(from.y, to.y), width, height);
      from = null;
    };
    svg.addEventListener("pointerup", end);
    svg.addEventListener("pointercancel", () => { if (mark) mark.remove(); from = null; });
    svg.addEventListener("dblclick", () => svg.setAttribute("viewBox", whole));
    card.append(bar(
      button("+", "Larger; or drag a rectangle over the picture", () => about(0.7)),
      button("−", "Smaller", () => about(1 / 0.7)),
      button("⟲", "The whole picture; or double click", () => svg.setAttribute("viewBox", whole)),
    ));
    window.addEventListener("beforeprint", () => svg.setAttribute("viewBox", whole));
  }

  function copyable(block) {
    const text = block.querySelector("pre");
    const select = () => { const range = document.createRange(); range.selectNodeContents(text); const all = getSelection(); all.removeAllRanges(); all.addRange(range); };
    const done = button("copy", "Copy this text", async () => {
      try {
        await navigator.clipboard.writeText(text.textContent);
      } catch {
        select();
        document.execCommand("copy");
      }
      done.textContent = "copied";
    });
    block.append(bar(done));
  }

  // A link to a window opens it.
  function open() {
    const wanted = location.hash && document.getElementById(location.hash.slice(1));
    if (wanted instanceof HTMLDetailsElement) {
      wanted.open = true;
      wanted.scrollIntoView();
    }
  }

  addEventListener("hashchange", open);
  open();
  document.querySelectorAll("[data-solid]").forEach(solid);
  document.querySelectorAll(".card.zoom").forEach(zoom);
  document.querySelectorAll(".copyable").forEach(copyable);
})();
