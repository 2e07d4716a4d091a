// Play, pause, speed and scrubbing: one time for the road and all charts.

export class Player {
  constructor(show) {
    const find = (id) => document.getElementById(id);
    Object.assign(this, { show, button: find("play"), slider: find("scrub"), clock: find("clock"), rate: find("rate") });
    this.time = 0;
    this.end = 1;
    this.playing = false;
    this.button.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek(this.end * this.slider.value / 1000));
  }

  until(end) {
    this.end = end;
    this.seek(Math.min(this.time, end));
  }

  seek(time) {
    this.time = time;
    this.slider.value = Math.round(1000 * time / this.end);
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(1)} s`);
    this.clock.value = `${time.toFixed(1)} s`;
    this.show(time);
  }

  toggle(on = !this.playing) {
    this.playing = on;
    this.button.textContent = on ? "Pause" : "Play";
    this.button.setAttribute("aria-pressed", on);
    if (!on) return;
    if (this.time >= this.end) this.time = 0;
    let before = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      this.seek(Math.min(this.end, this.time + (now - before) / 1000 * Number(this.rate.value)));
      before = now;
      if (this.time >= this.end) this.toggle(false);
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
}
