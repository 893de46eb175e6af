// The live page: listens to the status, and fetches the other views when something has changed.
"use strict";

// Minimum interval between fetches of the other views, in milliseconds, until the campaign is finished.
const PERIOD = 3000;
// Screen readers hear of the progress at most this often.
const SPOKEN_PERIOD = 30000;
// Delay before a lost connection is opened again; longer for a finished campaign.
const AGAIN = 2000;
const AGAIN_FINISHED = 30000;

const STAGES = {
  doe: "Design of experiments",
  sample: "Sampling",
  fit: "Kriging model",
  optimise: "Optimiser",
  enrich: "Enrichment",
  verify: "Verification",
  done: "Finished",
};
const STATES = { done: "done", current: "in progress", ahead: "to come" };

const at = (id) => document.getElementById(id);
const whole = new Intl.NumberFormat("en-GB", { maximumFractionDigits: 0 });
const short = new Intl.NumberFormat("en-GB", { maximumSignificantDigits: 4 });

// Numbers and text

function number(value) {
  if (value === null || value === undefined) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e9)) {
    const [digits, power] = value.toExponential(3).split("e");
    return `${digits} × 10${superscript(power)}`.replaceAll("-", "−");
  }
  return short.format(value).replaceAll("-", "−");
}

// A power of ten in raised digits, as in ⁻⁵.
function superscript(power) {
  return [...power.replace("+", "")].map((one) => (one === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[one])).join("");
}

function withUnit(value, unit) {
  return unit ? `${number(value)} ${unit}` : number(value);
}

function count(number, noun) {
  return `${whole.format(number)} ${noun}${number === 1 ? "" : "s"}`;
}

function span(seconds) {
  if (seconds < 90) return `${seconds.toFixed(0)} s`;
  if (seconds < 5400) return `${(seconds / 60).toFixed(0)} min`;
  if (seconds < 172800) return `${(seconds / 3600).toFixed(1)} h`;
  return `${(seconds / 86400).toFixed(1)} days`;
}

function rate(perSecond) {
  if (perSecond > 0 && perSecond < 0.1) return `${short.format(3600 * perSecond)} per hour`;
  return `${perSecond < 10 ? short.format(perSecond) : whole.format(perSecond)} per second`;
}

// Elements

// An element with text or child elements.
function element(name, content, properties = {}) {
  const made = document.createElement(name);
  if (Array.isArray(content)) made.append(...content);
  else if (content !== undefined) made.textContent = content;
  return Object.assign(made, properties);
}

// A cell as [text, class, scope]: a head if it has a scope.
function cell([content, className = "", scope = ""]) {
  const made = element(scope ? "th" : "td", content, { className });
  if (scope) made.scope = scope;
  return made;
}

function fill(table, rows) {
  const body = table.tBodies[0];
  body.replaceChildren(...rows.map((cells) => element("tr", cells.map(cell))));
  return body;
}

// Shows text only if it differs, so that nothing is read aloud again.
function say(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

// The figure of a chart; the numbers are in a table below it.
function figure(chart) {
  const picture = element("img", undefined, { alt: chart.description });
  picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(chart.svg)}`;
  const parts = [picture];
  if (chart.rows.length > 0) {
    const heads = chart.columns.map((name) => cell([name, "", "col"]));
    const rows = chart.rows.map((row) => element("tr", row.map((value) => cell([value]))));
    const table = element("table", [element("thead", [element("tr", heads)]), element("tbody", rows)]);
    const box = element("div", [table], { className: "scroll", tabIndex: 0 });
    box.setAttribute("role", "region");
    box.setAttribute("aria-label", chart.description);
    parts.push(element("details", [element("summary", "As a table"), box]));
  }
  return element("figure", parts);
}

// Replaces figures by new ones; tables that are open stay open, and focus stays where it is.
function figures(target, charts) {
  const before = [...target.children];
  charts.forEach((chart, place) => {
    const old = before[place];
    const key = chart.svg + chart.rows.join();
    if (old && old.shown === key) return;
    const made = Object.assign(figure(chart), { shown: key });
    if (!old) return void target.append(made);
    old.shown = key;
    const [picture, next] = [old.firstChild, made.firstChild];
    [picture.src, picture.alt] = [next.src, next.alt];
    const [details, fresh] = [old, made].map((one) => one.querySelector("details"));
    if (details && fresh) details.querySelector("table").replaceWith(fresh.querySelector("table"));
    else if (fresh) old.append(fresh);
    else if (details) details.remove();
  });
  before.slice(charts.length).forEach((old) => old.remove());
}

// The views

function timeToGo(live) {
  if (!live || live.eta_seconds === null) return ["not known yet", ""];
  const about = span(live.eta_seconds);
  const ends = [live.eta_low_seconds, live.eta_high_seconds].map((end) => (end === null ? "?" : span(end)));
  return [about, ends[0] === ends[1] ? "" : `probably ${ends[0]} to ${ends[1]}`];
}

function stageName(status) {
  const name = STAGES[status.stage] || status.stage;
  return status.stage === "enrich" && status.enrichment ? `${name}, round ${status.enrichment.round}` : name;
}

function showStatus(status) {
  document.title = `${status.campaign} – ${stageName(status)}`;
  say(at("campaign"), `“${status.campaign}”`);
  say(at("version"), status.program_version);
  const live = status.live;
  const [about, ends] = timeToGo(live);
  const tiles = [
    ["Stage", status.finished ? "Finished" : stageName(status), live && live.draining ? "draining: nothing more is leased" : ""],
    ["Samples of the DoE", whole.format(status.samples.done), `${whole.format(status.samples.per_design)} per design`],
    ["Designs", `${whole.format(status.designs.done)} of ${whole.format(status.designs.wanted)}`, `${whole.format(status.designs.simulable)} can be simulated`],
  ];
  if (live) {
    tiles.push(["Rate", rate(live.samples_per_second), "samples stored, recent rate"]);
    if (!status.finished) tiles.push(["Time to go in this stage", about, ends]);
    tiles.push(["Jobs", `${whole.format(live.jobs_leased)} leased`, `${whole.format(live.jobs_queued)} queued, ${whole.format(live.jobs_quarantined)} quarantined`]);
  }
  at("tiles").replaceChildren(...tiles.map(([label, value, more]) =>
    element("div", [element("dt", label), element("dd", more ? [value, element("span", more)] : value)])));

  const current = status.stages.map((stage) => {
    const share = stage.wanted > 0 ? stage.done / stage.wanted : 0;
    const bar = element("progress", undefined, { max: 1, value: Math.min(share, 1) });
    bar.setAttribute("aria-label", STAGES[stage.name] || stage.name);
    const percent = ` ${Math.floor(100 * share)} %`;
    return [
      [STAGES[stage.name] || stage.name, "", "row"],
      [stage.state === "ahead" && stage.done > 0 ? "begun" : STATES[stage.state] || stage.state, "text"],
      [[bar, percent], "text"],
      [whole.format(stage.done)],
      [stage.wanted > 0 ? whole.format(stage.wanted) : "–"],
      [stage.of, "text"],
    ];
  });
  const body = fill(at("stages"), current);
  status.stages.forEach((stage, place) => {
    if (stage.state === "current") body.rows[place].classList.add("now");
  });
  speak(status, about);
}

let spoken = { stage: "", at: 0 };

function speak(status, about) {
  const now = Date.now();
  if (status.stage === spoken.stage && now - spoken.at < SPOKEN_PERIOD) return;
  spoken = { stage: status.stage, at: now };
  const current = status.stages.find((stage) => stage.state === "current");
  const done = current ? `${whole.format(current.done)} of ${whole.format(current.wanted)} ${current.of}. ` : "";
  const rest = status.live && !status.finished ? `Time to go: ${about}.` : "";
  say(at("spoken"), `${stageName(status)}. ${done}${rest}`);
}

function workerState(worker) {
  if (worker.is_suspended) return "suspended after failures";
  if (isFinished) return "finished";
  if (worker.silent_seconds > 15) return "silent";
  return worker.leased > 0 ? "working" : "waiting";
}

function showWorkers(view) {
  at("workers-box").hidden = view.workers.length === 0;
  say(at("workers-note"), !view.running
    ? "The store alone was asked: it does not know the workers."
    : view.workers.length === 0 ? "No worker has registered." : `${count(view.workers.length, "worker")}.`);
  fill(at("workers-table"), view.workers.map((worker) => [
    [worker.host, "", "row"],
    [whole.format(worker.slots)],
    [number(worker.samples_per_second)],
    [whole.format(worker.leased)],
    [whole.format(worker.completed)],
    [whole.format(worker.failed)],
    [worker.silent_seconds.toFixed(1)],
    [workerState(worker), "text"],
  ]));
}

function showFailures(view) {
  at("failures-box").hidden = view.groups.length === 0;
  say(at("failures-note"), view.failures === 0 ? "Nothing has failed." : `${count(view.failures, "failure")} on record.`);
  fill(at("failures-table"), view.groups.map((group) => [
    [whole.format(group.count)],
    [group.kind, "text"],
    [group.cause, "cause"],
    [`${group.last_job}: ${group.last_error}`, "cause"],
  ]));
}

function showBest(view) {
  say(at("best-note"), view.note);
  const best = view.best;
  at("best-tables").hidden = !best;
  figures(at("best-charts"), best ? best.charts : []);
  if (!best) return say(at("best-value"), "");
  say(at("best-value"), `${view.measure} of ${view.response} = ${withUnit(best.value, view.unit)}` +
    ` (${best.low === null ? "no 95 % interval" : `95 % interval ${number(best.low)} to ${withUnit(best.high, view.unit)}`}, ` +
    `${whole.format(best.samples)} samples): ${best.name}.`);
  fill(at("variables"), best.variables.map((one, place) => [[best.variable_labels[place], "", "row"], [best.variable_texts[place]]]));
  at("constraints-box").hidden = best.constraints.length === 0;
  fill(at("constraints"), best.constraints.map((one, place) => {
    const [value, limit, margin] = best.constraint_texts[place];
    return [
      [one.name, "", "row"],
      [one.holds ? "holds" : "▲ broken", one.holds ? "text" : "text mark"],
      [margin, one.holds ? "" : "mark"],
      [value],
      [`${one.relation} ${limit}`],
    ];
  }));
}

function fetchMap() {
  const [x, y] = [at("axis-x"), at("axis-y")].map((select) => Math.max(select.selectedIndex, 0));
  return view(`map/${x}/${y}`, showMap);
}

function showMap(view) {
  const shown = view.shown < view.designs ? `, ${whole.format(view.shown)} of them shown` : "";
  say(at("map-note"), view.designs === 0
    ? "No design has a response yet."
    : `${view.measure} of ${count(view.designs, "design")}${shown}.` +
      (view.preliminary ? " Preliminary: of each design’s first samples." : ""));
  at("axes").hidden = view.coordinates.length < 2 || view.designs === 0;
  if (at("axis-x").options.length !== view.coordinates.length) {
    const names = view.coordinates.map((one) => one.label);
    [at("axis-x"), at("axis-y")].forEach((select, place) => {
      select.replaceChildren(...names.map((name, index) => element("option", name, { value: index })));
      select.selectedIndex = Math.min(place, names.length - 1);
    });
    return fetchMap();
  }
  figures(at("map-chart"), view.chart ? [view.chart] : []);
}

function showConvergence(view) {
  at("convergence-note").hidden = view.approaches.length > 0;
  figures(at("convergence-charts"), view.approaches.flatMap((one) => (one.chart ? [one.chart] : [])));
}

function showRounds(view) {
  at("rounds").hidden = at("rounds-link").hidden = !view.enriches;
  say(at("rounds-note"), view.rounds.length === 0
    ? "No round has been decided yet."
    : `${count(view.rounds.length, "round")}. ${view.stop || "The enrichment goes on; its prediction is not verified."}`);
  at("rounds-box").hidden = view.rounds.length === 0;
  figures(at("rounds-charts"), view.charts);
  fill(at("rounds-table"), view.rounds.map((round) => [
    [whole.format(round.round)],
    [whole.format(round.new_designs)],
    [whole.format(round.further_turns)],
    [whole.format(round.samples)],
    [whole.format(round.failed)],
    [number(round.expected_improvement)],
    [number(round.predicted)],
    [`${number(round.low)} to ${number(round.high)}`],
  ]));
}

// Fetching

// The ETag of each view as last drawn; an unchanged view is not drawn again.
const known = new Map();

// Fetches a view and shows it if it has changed.
async function view(name, show) {
  const answer = await fetch(`api/v1/${name}`, { cache: "no-cache" });
  const tag = answer.headers.get("etag");
  if (!answer.ok) throw new Error((await answer.json()).error);
  if (known.get(name) !== tag || name.startsWith("map/")) await show(await answer.json());
  known.set(name, tag);
}

const VIEWS = [
  ["workers", showWorkers],
  ["failures", showFailures],
  ["best", showBest],
  ["convergence", showConvergence],
  ["rounds", showRounds],
];

let fetching = false;
let fetchedAt = -Infinity;
let planned = 0;
let isFinished = false;

// A lost connection (a TypeError) is reported by the event source.
function trouble(error) {
  if (!(error instanceof TypeError)) connection(error.message, true);
}

// Fetches all views: at once if the campaign is finished, otherwise when PERIOD has passed. Waits for a fetch in progress.
async function fetchViews() {
  const due = isFinished ? 0 : fetchedAt + PERIOD - performance.now();
  const wait = fetching ? Math.max(due, 100) : due;
  clearTimeout(planned);
  if (wait > 0) {
    planned = setTimeout(fetchViews, wait);
    return;
  }
  fetching = true;
  fetchedAt = performance.now();
  try {
    await Promise.all([...VIEWS.map(([name, show]) => view(name, show)), fetchMap()]);
  } catch (error) {
    trouble(error);
  } finally {
    fetching = false;
  }
}

// Listening

let source = null;

function connection(text, isLost) {
  say(at("connection"), text);
  at("connection").classList.toggle("lost", isLost);
}

function listen() {
  source = new EventSource("api/v1/events");
  source.addEventListener("status", (event) => {
    const status = JSON.parse(event.data);
    isFinished = status.finished;
    connection(isFinished ? "The campaign is finished."
      : status.live ? "Connected: the page follows the campaign."
        : "The store alone was asked: what workers do is not known.", false);
    showStatus(status);
    // A coordinator that ends with its campaign answers until no page has asked for a second.
    fetchViews();
  });
  source.addEventListener("trouble", (event) => {
    connection(`The store cannot be read: ${JSON.parse(event.data).error}`, true);
  });
  source.addEventListener("error", () => {
    source.close();
    if (!isFinished) connection("Connection lost: the numbers are the last ones. Trying again …", true);
    setTimeout(() => { if (!document.hidden && source.readyState === EventSource.CLOSED) listen(); }, isFinished ? AGAIN_FINISHED : AGAIN);
  });
}

for (const id of ["axis-x", "axis-y"]) at(id).addEventListener("change", () => fetchMap().catch(trouble));
// A browser opens few connections to one server: pages that nobody sees hold none.
document.addEventListener("visibilitychange", () => {
  if (document.hidden) source.close();
  else if (source.readyState === EventSource.CLOSED) listen();
});
listen();
