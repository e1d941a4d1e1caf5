// Text around the scene: strategies with their errors, legend, summary. User text is never set as HTML.

const element = (name, options = {}, ...children) => {
  const node = Object.assign(document.createElement(name), options);
  node.append(...children);
  return node;
};
const byId = (id) => document.getElementById(id);
const inCentimeters = (error) => (error === null ? "–" : `${(100 * error).toFixed(2)} cm`);
const inDegrees = (angle) => (angle === null ? "" : `axis ${((angle * 180) / Math.PI).toFixed(1)}°`);

// A button for each strategy; pressing one shows its arm.
class TraceList {
  constructor(run, choose) {
    this.rows = run.traces.map((trace, k) => {
      const hasErrors = trace.errors.some((error) => error !== null);
      const none = hasErrors ? "no step counts" : "no desired position";
      const where = trace.uncounted.length ? " outside the shade" : "";
      const parts = {
        mark: element("span", { className: "mark" }),
        name: element("span", { className: "name", textContent: trace.label }),
        now: element("span", { className: "now" }),
        mean: element("span", {
          className: "mean",
          textContent: trace.meanError === null ? none : `mean ${inCentimeters(trace.meanError)}${where}`,
        }),
        angle: element("span", { className: "angle" }),
        plan: element("span", { className: "plan" }),
      };
      parts.mark.style.background = trace.color;
      const button = element(
        "button",
        { type: "button", className: "trace", onclick: () => choose(k) },
        ...Object.values(parts),
      );
      button.setAttribute("role", "radio");
      return { ...parts, button };
    });
    byId("traces").append(...this.rows.map((row) => row.button));
    const hasErrors = run.traces.some((trace) => trace.errors.some((error) => error !== null));
    byId("errors-heading").textContent = !hasErrors
      ? "Runs"
      : `Error at the end of module ${run.traces[0].followed + 1} of ${run.arm.lengths.length}`;
  }

  show(moments, chosen) {
    this.rows.forEach((row, k) => {
      row.now.textContent = inCentimeters(moments[k].error);
      row.angle.textContent = inDegrees(moments[k].axisError);
      row.plan.textContent = moments[k].plan;
      row.button.setAttribute("aria-checked", String(k === chosen));
    });
  }
}

function writeSummary(run) {
  byId("summary-section").hidden = run.summary.length === 0;
  for (const [name, value] of run.summary) {
    byId("summary").append(element("dt", { textContent: name }), element("dd", { textContent: value }));
  }
  const count = run.arm.lengths.length;
  byId("subtitle").textContent =
    `${run.arm.name} · ${count} module${count === 1 ? "" : "s"} · ${run.end.toFixed(1)} s`;
}

// The legend lists only what the scene shows.
function writeKey(run, chosen) {
  const items = [],
    trace = run.traces[chosen];
  const item = (kind, style, text) => {
    const mark = element("i", { className: kind });
    Object.assign(mark.style, style);
    items.push(element("li", {}, mark, element("span", { textContent: text })));
  };
  const ramp =
    run.arm.colors.length > 1 ? `linear-gradient(90deg, ${run.arm.colors.join(", ")})` : run.arm.colors[0];
  item("bar", { background: ramp }, "base to end");
  if (trace.desired.length || trace.axes.length) item("line", { borderColor: run.colors.desired }, "desired");
  item("line", { borderColor: trace.color }, trace.label);
  if (trace.horizon.some((tips) => tips.some(Boolean))) item("line", { borderColor: run.colors.horizon }, "planned");
  if (trace.tube.length) item("bar", { background: tint(trace.color, 0.2) }, "predicted ± 2 std");
  if (trace.obstacles.some((step) => step.length)) item("dot", { background: run.colors.obstacle }, "obstacle");
  byId("key").replaceChildren(...items);
}
