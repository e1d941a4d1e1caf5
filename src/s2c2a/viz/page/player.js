// Playback: plays, pauses, steps and scrubs.

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const SHAPES = { play: "M8 5v14l11-7z", pause: "M6 5h4v14H6zM14 5h4v14h-4z" };

class Player {
  constructor(run, changed) {
    Object.assign(this, { run, changed, time: run.start, speed: 1, playing: false, last: null });
    const slider = byId("slider");
    Object.assign(slider, { min: run.start, max: run.end > run.start ? run.end : run.start + 1, value: run.start });
    slider.addEventListener("input", () => this.go(+slider.value));
    byId("play").addEventListener("click", () => this.toggle());
    this.speedButtons = SPEEDS.map((speed) => {
      const button = element("button", {
        type: "button",
        textContent: `${speed}×`,
        onclick: () => this.setSpeed(speed),
      });
      button.setAttribute("role", "radio");
      return button;
    });
    byId("speeds").append(...this.speedButtons);
    this.setSpeed(1);
    addEventListener("keydown", (event) => this.press(event));
  }

  setSpeed(speed) {
    this.speed = speed;
    this.speedButtons.forEach((button, k) => button.setAttribute("aria-checked", String(SPEEDS[k] === speed)));
  }

  // Go to a time and pause there.
  go(time) {
    this.play(false);
    this.time = clamp(time, this.run.start, this.run.end);
    this.changed();
  }

  toggle() {
    this.play(!this.playing);
  }

  play(on) {
    if (on && this.time >= this.run.end) this.time = this.run.start;
    if (on !== this.playing) {
      this.playing = on;
      this.last = null;
      byId("play-shape").setAttribute("d", SHAPES[on ? "pause" : "play"]);
      byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
    }
    this.changed();
  }

  // Called in every frame while playing; `now` in milliseconds.
  advance(now) {
    if (!this.playing) return;
    if (this.last !== null) this.time += (Math.min(now - this.last, 250) / 1000) * this.speed;
    this.last = now;
    if (this.time >= this.run.end) {
      this.time = this.run.end;
      this.play(false);
    }
  }

  stepBy(count) {
    const times = this.run.traces[this.run.chosen].times;
    const { step, share } = stepAt(times, this.time);
    this.go(times[clamp(step + count + (count < 0 && share > 0.001 ? 1 : 0), 0, times.length - 1)]);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const actions = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.stepBy(event.shiftKey ? -10 : -1),
      ArrowRight: () => this.stepBy(event.shiftKey ? 10 : 1),
      Home: () => this.go(this.run.start),
      End: () => this.go(this.run.end),
    };
    const onButton = event.key === " " && event.target.closest("button");
    if (!actions[event.key] || onButton) return;
    event.preventDefault();
    actions[event.key]();
  }

  show() {
    byId("slider").value = this.time;
    const places = this.run.end - this.run.start < 10 ? 2 : 1;
    byId("clock").textContent = `${this.time.toFixed(places)} / ${this.run.end.toFixed(places)} s`;
  }
}
