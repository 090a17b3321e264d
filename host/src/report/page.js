"use strict";
(() => {
  const MINUS = "\u2212";
  const FRAMES_PER_SECOND = 12;

  /** One scene: a scrubber that moves all its images and the cursor in its curves. */
  class Scene {
    constructor(section) {
      this.section = section;
      this.range = section.querySelector("input[type=range]");
      this.button = section.querySelector(".play");
      this.output = section.querySelector("output");
      this.stacks = [...section.querySelectorAll(".stack")].map((stack) => [
        ...stack.querySelectorAll("img"),
      ]);
      this.shown = this.stacks.map(() => 0);
      this.cursor = section.querySelector(".cursor");
      this.values = section.querySelector(".values");
      const chart = section.querySelector(".chart");
      this.curves = chart ? JSON.parse(chart.dataset.curves) : [];
      this.last = Number(this.range.max);
      this.timer = 0;
      this.range.addEventListener("input", () => this.show(Number(this.range.value)));
      this.button.addEventListener("click", () => this.toggle());
      this.show(Number(this.range.value));
    }

    show(wanted) {
      const frame = Math.min(Math.max(wanted, 0), this.last);
      this.range.value = String(frame);
      const text = `frame ${frame} of ${this.last}`;
      this.output.textContent = text;
      this.range.setAttribute("aria-valuetext", text);
      this.stacks.forEach((images, stack) => {
        if (images.length === 0) return;
        const next = Math.min(frame, images.length - 1);
        images[this.shown[stack]].hidden = true;
        images[next].hidden = false;
        this.shown[stack] = next;
      });
      if (this.cursor) {
        const shift = frame * Number(this.cursor.dataset.step);
        this.cursor.setAttribute("transform", `translate(${shift} 0)`);
      }
      this.read(frame);
    }

    /** Writes the value of every curve at a frame below the chart. */
    read(frame) {
      if (!this.values) return;
      const spans = this.curves.map(([label, values]) => {
        const value = values[frame];
        const known = typeof value === "number";
        const number = known ? value.toFixed(2).replace("-", MINUS) + " rad" : "no value";
        const span = document.createElement("span");
        span.textContent = `${label}: ${number}`;
        return span;
      });
      this.values.replaceChildren(...spans);
    }

    get frame() {
      return Number(this.range.value);
    }

    toggle() {
      if (this.timer) return this.stop();
      this.button.textContent = "\u275a\u275a";
      this.button.setAttribute("aria-label", "Pause");
      const next = () => this.show(this.frame < this.last ? this.frame + 1 : 0);
      this.timer = setInterval(next, 1000 / FRAMES_PER_SECOND);
    }

    stop() {
      clearInterval(this.timer);
      this.timer = 0;
      this.button.textContent = "\u25b6";
      this.button.setAttribute("aria-label", "Play");
    }
  }

  const scenes = [...document.querySelectorAll(".scene")].map((section) => new Scene(section));
  const tabs = [...document.querySelectorAll("[role=tab]")];
  let current = 0;

  /** Shows one scene, at the frame the one before it had. */
  function choose(wanted) {
    const frame = scenes[current].frame;
    scenes[current].stop();
    current = (wanted + scenes.length) % scenes.length;
    scenes.forEach((scene, n) => {
      scene.section.hidden = n !== current;
    });
    tabs.forEach((tab, n) => {
      tab.setAttribute("aria-selected", String(n === current));
      tab.tabIndex = n === current ? 0 : -1;
    });
    scenes[current].show(frame);
  }

  if (tabs.length > 0) {
    tabs[0].parentElement.hidden = false;
    scenes.forEach((scene, n) => {
      scene.section.setAttribute("role", "tabpanel");
      scene.section.setAttribute("aria-labelledby", tabs[n].id);
    });
    tabs.forEach((tab, n) => tab.addEventListener("click", () => choose(n)));
    choose(0);
  }

  /** Arrow keys: between tabs when one has the focus, else from frame to frame. */
  document.addEventListener("keydown", (event) => {
    const target = event.target;
    const plain = !(event.ctrlKey || event.altKey || event.metaKey || event.shiftKey);
    if (!plain || scenes.length === 0 || target.matches("input")) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const scene = scenes[current];
    if (step && target.matches("[role=tab]")) {
      choose(current + step);
      tabs[current].focus();
    } else if (step) {
      scene.show(scene.frame + step);
    } else if (event.key === " " && !target.matches("button")) {
      scene.toggle();
    } else {
      return;
    }
    event.preventDefault();
  });
})();
