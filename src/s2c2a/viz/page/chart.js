// The error of every strategy over time, with a cursor.

const MAX_BAND = 3; // of the largest error: a higher band leaves the chart
const EDGE = { left: 30, right: 6, top: 8, bottom: 22 };

class Chart {
  constructor(canvas, run) {
    Object.assign(this, { canvas, run, context: canvas.getContext("2d") });
    this.highest = Math.max(...run.traces.flatMap((trace) => trace.errors.filter((error) => error !== null))) * 100;
    this.empty = !Number.isFinite(this.highest);
    const radii = run.traces.flatMap((trace) => trace.tube.map((ball) => (ball ? ball.radius : 0)));
    this.highest = Math.max(this.highest, Math.min(100 * Math.max(0, ...radii), MAX_BAND * this.highest));
  }

  resize() {
    this.size = sizeCanvas(this.canvas, this.context);
    this.step = roundAbove(Math.max(this.highest, 0.01) / 4);
    this.top = Math.max(this.highest * 1.04, this.step);
  }

  x(time) {
    const share = (time - this.run.start) / (this.run.end - this.run.start || 1);
    return EDGE.left + share * (this.size[0] - EDGE.left - EDGE.right);
  }

  y(centimeters) {
    return this.size[1] - EDGE.bottom - (centimeters / this.top) * (this.size[1] - EDGE.top - EDGE.bottom);
  }

  timeAt(clientX) {
    const box = this.canvas.getBoundingClientRect();
    const share = (clientX - box.left - EDGE.left) / (box.width - EDGE.left - EDGE.right);
    return this.run.start + clamp(share, 0, 1) * (this.run.end - this.run.start);
  }

  draw(time, moments, chosen) {
    const { context } = this;
    context.clearRect(0, 0, ...this.size);
    this.shade(this.run.traces[chosen].uncounted);
    this.drawBand(this.run.traces[chosen]);
    this.drawFrame();
    this.run.traces.forEach((trace, k) => k !== chosen && this.drawCurve(trace, 1.3, 0.75));
    this.drawCurve(this.run.traces[chosen], 2.3, 1);
    paintLine(context, {
      places: [
        { x: this.x(time), y: EDGE.top },
        { x: this.x(time), y: this.y(0) },
      ],
      stroke: this.run.colors.ink,
      width: 1.2,
    });
    moments.forEach(({ error }, k) => {
      if (error !== null)
        paintDot(
          context,
          { x: this.x(time), y: this.y(100 * error) },
          k === chosen ? 4.2 : 3,
          this.run.traces[k].color,
        );
    });
  }

  // Shade the steps that the mean leaves out.
  shade(spans) {
    this.context.fillStyle = this.run.colors.uncounted;
    for (const [start, end] of spans) {
      this.context.fillRect(this.x(start), EDGE.top, this.x(end) - this.x(start), this.y(0) - EDGE.top);
    }
  }

  // Shade the errors up to twice the predictive standard deviation, between steps that have one.
  drawBand({ times, tube, color }) {
    this.context.fillStyle = tint(color, 0.2, [255, 255, 255]);
    const top = (ball) => Math.max(this.y(100 * ball.radius), EDGE.top);
    for (let k = 1; k < tube.length; k++) {
      if (!tube[k - 1] || !tube[k]) continue;
      const left = this.x(times[k - 1]),
        right = this.x(times[k]) + 1; // no seams
      this.context.beginPath();
      this.context.moveTo(left, this.y(0));
      this.context.lineTo(left, top(tube[k - 1]));
      this.context.lineTo(right, top(tube[k]));
      this.context.lineTo(right, this.y(0));
      this.context.fill();
    }
  }

  drawFrame() {
    const { context } = this;
    context.font = "11.5px system-ui, sans-serif";
    context.fillStyle = "#566173";
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (let value = 0; value <= this.top; value += this.step) {
      const y = Math.round(this.y(value)) + 0.5;
      paintLine(context, {
        places: [
          { x: EDGE.left, y },
          { x: this.size[0] - EDGE.right, y },
        ],
        stroke: value ? "#e6eaf0" : "#b9c2cd",
        width: 1,
      });
      context.fillText(shortNumber(value), EDGE.left - 6, y);
    }
    this.drawTimes();
  }

  drawTimes() {
    const step = roundAbove((this.run.end - this.run.start || 1) / 5),
      last = this.size[0] - EDGE.right;
    this.context.textAlign = "center";
    for (let time = Math.ceil(this.run.start / step) * step; time <= this.run.end + 1e-9; time += step) {
      const x = this.x(time);
      this.context.fillText(`${shortNumber(time)} s`, Math.min(x, last - 9), this.size[1] - 9);
    }
    this.context.textAlign = "right";
  }

  drawCurve(trace, width, alpha) {
    const { context } = this;
    context.beginPath();
    let open = false;
    trace.errors.forEach((error, k) => {
      if (error !== null) context[open ? "lineTo" : "moveTo"](this.x(trace.times[k]), this.y(100 * error));
      open = error !== null;
    });
    context.globalAlpha = alpha;
    context.strokeStyle = trace.color;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.stroke();
    context.globalAlpha = 1;
  }
}

const shortNumber = (value) => String(+value.toPrecision(6));
