// Steps that play, sliders between two pictures, and pictures in full. The page is whole without it.
"use strict";

function element(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// A click shows a picture in full: as large as the window, with its pixels as squares.
const full = element("dialog", { className: "full" });
document.body.append(full);
full.addEventListener("click", () => full.close());

function open_full(image) {
  const copy = element("img", { src: image.src, alt: image.alt });
  full.replaceChildren(copy, element("p", { textContent: `${image.alt} (${image.naturalWidth} × ${image.naturalHeight} pixels)` }));
  full.showModal();
}

function on_press(target, label, act) {
  target.tabIndex = 0;
  target.setAttribute("role", "button");
  target.setAttribute("aria-label", label);
  target.addEventListener("click", act);
  target.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      act();
    }
  });
}

// Two pictures on one place. The first figure stays on the right, another one comes to the left.
function compare(box) {
  const [right, ...others] = [...box.children];
  const image = (figure) => figure.querySelector("img");
  const label = (figure) => figure.querySelector("figcaption").textContent;
  const after = image(right);
  const before = element("img", { className: "before" });
  const stage = element("div", { className: "stage" }, after, before, element("span", { className: "line" }));
  const slider = element("input", { type: "range", min: 0, max: 100, value: 50 });
  slider.setAttribute("aria-label", "Share of the left picture");
  const names = [element("span"), element("span", { textContent: label(right) })];
  const choice = element("div", { className: "choice" });

  function move(share) {
    slider.value = share;
    stage.style.setProperty("--at", `${slider.value}%`);
  }
  function choose(figure) {
    Object.assign(before, { src: image(figure).src, alt: label(figure) });
    names[0].textContent = label(figure);
    slider.setAttribute("aria-valuetext", `${label(figure)} beside ${label(right)}`);
    for (const other of others) other.setAttribute("aria-pressed", other === figure);
  }
  for (const figure of others) on_press(figure, `Compare with: ${label(figure)}`, () => choose(figure));
  choice.append(...others);
  slider.addEventListener("input", () => move(slider.value));

  // A drag moves the line, and a click opens the picture that is seen there.
  let pressed_at = null;
  const share_at = (event) => {
    const { left, width } = stage.getBoundingClientRect();
    return (100 * (event.clientX - left)) / width;
  };
  stage.addEventListener("pointerdown", (event) => {
    pressed_at = event.clientX;
    stage.setPointerCapture(event.pointerId);
  });
  stage.addEventListener("pointermove", (event) => {
    if (pressed_at !== null && Math.abs(event.clientX - pressed_at) > 4) {
      pressed_at = Infinity;
      move(share_at(event));
    }
  });
  stage.addEventListener("pointerup", (event) => {
    if (pressed_at !== null && pressed_at !== Infinity) open_full(share_at(event) < slider.value ? before : after);
    pressed_at = null;
  });
  stage.addEventListener("pointercancel", () => (pressed_at = null));
  stage.addEventListener("dragstart", (event) => event.preventDefault());

  right.remove();
  const sides = element("p", { className: "sides" }, ...names);
  box.append(element("div", { className: "pair" }, stage, slider, sides), choice);
  box.classList.add("live");
  choose(others.find((figure) => label(figure).startsWith("The photon map")) ?? others[0]);
  move(50);
}

// One step after the other, frame by frame.
function story(box) {
  const steps = [...box.querySelectorAll(".step")];
  const frames = steps.flatMap((step, index) => Array.from({ length: Number(step.dataset.frames) }, (_, frame) => ({ step, index, frame })));
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let at = 0;
  let timer = null;

  const back = element("button", { type: "button", textContent: "Back" });
  const play = element("button", { type: "button", className: "play" });
  const next = element("button", { type: "button", textContent: "Next" });
  const slider = element("input", { type: "range", min: 0, max: frames.length - 1, value: 0 });
  slider.setAttribute("aria-label", "Place in the four steps");
  const place = element("output");
  const chips = steps.map((step, index) => {
    const chip = element("button", { type: "button", textContent: step.querySelector("h4").textContent });
    chip.addEventListener("click", () => by_hand(frames.findIndex((frame) => frame.index === index)));
    return chip;
  });

  function show(to) {
    at = Math.max(0, Math.min(frames.length - 1, to));
    const { step, index, frame } = frames[at];
    for (const other of steps) other.classList.toggle("now", other === step);
    for (const part of step.querySelectorAll("[data-from]")) {
      part.classList.toggle("hidden", frame < Number(part.dataset.from) || frame > Number(part.dataset.to));
    }
    chips.forEach((chip, number) => chip.setAttribute("aria-pressed", number === index));
    slider.value = at;
    place.textContent = `step ${index + 1} of ${steps.length}, picture ${frame + 1} of ${step.dataset.frames}`;
    back.disabled = at === 0;
    next.disabled = at === frames.length - 1;
  }
  function stop() {
    clearTimeout(timer);
    timer = null;
    play.textContent = at === frames.length - 1 ? "Play again" : "Play";
  }
  function tick() {
    if (at === frames.length - 1) return stop();
    const { frame, step } = frames[at];
    // Time to read where a step begins or ends.
    const long = frame === 0 || frame === step.dataset.frames - 1;
    timer = setTimeout(() => {
      show(at + 1);
      tick();
    }, long ? 3500 : 1200);
  }
  function start() {
    if (at === frames.length - 1) show(0);
    play.textContent = "Pause";
    tick();
  }
  function by_hand(to) {
    show(to);
    stop();
  }
  back.addEventListener("click", () => by_hand(at - 1));
  next.addEventListener("click", () => by_hand(at + 1));
  slider.addEventListener("input", () => by_hand(Number(slider.value)));
  play.addEventListener("click", () => (timer === null ? start() : stop()));

  box.prepend(element("div", { className: "chips" }, ...chips), element("div", { className: "controls" }, back, play, next, slider, place));
  box.classList.add("live");
  show(0);
  stop();
  // It plays once when it comes into view, unless less motion is asked for.
  if (!still) {
    const seen = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) {
        seen.disconnect();
        if (timer === null && at === 0) start();
      }
    }, { threshold: 0.6 });
    seen.observe(box);
  }
}

// Squares for pixels where a picture is enlarged; a smooth picture where it is made smaller.
const sampling = new ResizeObserver((entries) => {
  for (const { target } of entries) target.classList.toggle("smaller", target.naturalWidth > target.clientWidth * devicePixelRatio);
});

document.querySelectorAll(".compare").forEach(compare);
document.querySelectorAll(".story").forEach(story);
for (const image of document.querySelectorAll("figure img")) {
  if (!image.closest(".choice")) on_press(image, `Show in full: ${image.alt}`, () => open_full(image));
}
for (const image of document.querySelectorAll("img")) sampling.observe(image);
// Last, so that no hint stands where a script failed.
document.documentElement.classList.add("scripts");
