// Values from the server become text and shapes, never markup.

const find = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

function made(name, text, className) {
  const element = document.createElement(name);
  if (text !== undefined) element.textContent = text;
  if (className) element.className = className;
  return element;
}

function shape(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

const spoken = (name) => {
  const text = name.replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
};

// Rows and items are replaced only when their text changes, so that screen readers and selections are not disturbed.
const shownIn = new Map();

function fill(id, items, draw) {
  const text = JSON.stringify(items);
  if (shownIn.get(id) === text) return;
  shownIn.set(id, text);
  find(id).replaceChildren(...items.map(draw));
  const empty = find(`no-${id}`);
  if (empty) empty.hidden = items.length > 0;
}

function row(first, ...cells) {
  const line = made("tr");
  const head = made("th", first);
  head.scope = "row";
  line.append(head, ...cells.map((cell) => (cell instanceof Node ? cell : made("td", cell))));
  return line;
}

function valueText(attribute) {
  if (attribute.value === null) return `unknown (${attribute.reason.toLowerCase()})`;
  if (attribute.value === true) return "yes";
  if (attribute.value === false) return "no";
  if (typeof attribute.value !== "number") return spoken(attribute.value);
  const unit = { percent: "%", rad: "rad" }[attribute.unit] ?? attribute.unit;
  return `${attribute.value.toFixed(Number.isInteger(attribute.value) ? 0 : 2)} ${unit}`.trim();
}

function item(attribute) {
  const line = made("li");
  line.append(made("span", attribute.label), made("b", valueText(attribute), attribute.value === null ? "unknown" : ""));
  return line;
}

function share(attribute) {
  const line = item(attribute);
  if (typeof attribute.value === "number" && attribute.unit === "") {
    const meter = made("meter");
    meter.min = 0;
    meter.max = 1;
    meter.value = attribute.value;
    meter.setAttribute("aria-hidden", "true");
    line.append(meter);
  }
  return line;
}

const degrees = (angle) => (angle * 180) / Math.PI;

function put(element, placed) {
  element.toggleAttribute("hidden", placed === null);
  if (placed === null) return;
  element.setAttribute("transform", `translate(${placed.x_m} ${-placed.y_m}) rotate(${-degrees(placed.heading_rad)})`);
  element.classList.toggle("stale", placed.outcome === "stale");
}

function drawContainer(placed) {
  const { corner, side } = find("containers").dataset;
  const box = shape("rect", { class: "container", x: corner, y: corner, width: side, height: side });
  if (placed.is_carried) box.classList.add("carried");
  put(box, placed);
  return box;
}

function drawPerson(placed) {
  const group = shape("g", {});
  const number = placed.name.replace("person_", "");
  const label = shape("text", { y: -0.45 });
  label.textContent = `P${number}`;
  group.append(shape("circle", { class: "person", r: find("people").dataset.radius }), label);
  put(group, { ...placed, heading_rad: 0 });
  return group;
}

function metres(placed) {
  return `${placed.x_m.toFixed(1)} m east, ${placed.y_m.toFixed(1)} m north`;
}

function summary(view, people, containers) {
  if (view.robot === null) return "The robot's position is not known yet.";
  const carried = containers.some((container) => container.is_carried) ? ", carrying a container" : "";
  const old = view.robot.outcome === "stale" ? " (an old pose)" : "";
  return (
    `Robot (blue) at ${metres(view.robot)}${old}${carried}. ` +
    `People seen: ${people.length}. Containers known: ${containers.length}.` +
    (view.goal === null ? "" : ` Last goal (cross) at ${metres(view.goal)}.`)
  );
}

function showMap(view) {
  const people = view.people.filter((person) => person !== null);
  const containers = view.containers.filter((container) => container !== null);
  put(find("robot"), view.robot);
  put(find("goal"), view.goal);
  fill("containers", containers, drawContainer);
  fill("people", people, drawPerson);
  find("map-text").textContent = summary(view, people, containers);
}

const NEW = "new: not taken up yet";

function orderState(order) {
  const cell = made("td", order.state || NEW, order.state || "new");
  if (order.state && order.state !== "open") return cell;
  const button = made("button", "Take back", "take-back");
  button.type = "button";
  button.setAttribute("aria-label", `Take back ${spoken(order.name).toLowerCase()}`);
  button.addEventListener("click", () =>
    busy(button, () => ask("cancel", { order: order.name }, () => `${spoken(order.name)} is taken back.`)),
  );
  cell.append(" ", button);
  return cell;
}

function showOrders(orders) {
  fill("orders", orders.toReversed?.() ?? [...orders].reverse(), (order) =>
    row(
      `${spoken(order.name)}: ${order.kind}`,
      spoken(order.of_area),
      spoken(order.to_area),
      orderState(order),
    ),
  );
}

function stageText(task) {
  const who = spoken(task.requester).toLowerCase();
  const texts = { "": "never asked for", wants: `asked for by ${who}`, is: `under way for ${who}` };
  return texts[task.stage] ?? task.stage;
}

function showTasks(tasks) {
  fill("tasks", tasks, (task) =>
    row(
      spoken(task.name),
      spoken(task.by),
      made("td", stageText(task), task.stage),
      task.outcome ? spoken(task.outcome) : "–",
    ),
  );
}

function showLoop(loop) {
  fill("loop", loop, (phase) =>
    row(
      spoken(phase.phase),
      phase.agents.map((name) => spoken(name).toLowerCase()).join(", ") || "none in this run",
      phase.wrote_s === null ? "–" : `${phase.wrote_s.toFixed(1)} s`,
    ),
  );
}

function show(view) {
  find("instant").textContent = `${view.instant_s.toFixed(1)} s, change ${view.version}`;
  showMap(view);
  showOrders(view.orders);
  showTasks(view.tasks);
  showLoop(view.loop);
  fill("courses", view.courses, item);
  fill("metrics", view.metrics, share);
  fill("weights", view.weights, share);
  fill("parameters", view.parameters, item);
  fill("readings", view.readings, item);
  fill("refusals", view.refusals, (refusal) =>
    made("li", `${refusal.instant_s.toFixed(1)} s, ${refusal.agent}: ${refusal.why}`),
  );
  const load = view.readings.find((reading) => reading.name === "robot.container_load");
  for (const button of document.querySelectorAll("button[name=load]")) {
    button.setAttribute("aria-pressed", String(load !== undefined && load.value === button.value));
  }
}

function connected(text) {
  if (find("connection").textContent !== text) find("connection").textContent = text;
}

const events = new EventSource("events");
events.onopen = () => connected("Live.");
events.onerror = () => connected("No connection: the values shown are old. Trying again …");
events.onmessage = (event) => {
  connected("Live.");
  show(JSON.parse(event.data));
};

async function ask(where, what, done) {
  find("answer").textContent = "";
  find("problem").textContent = "";
  try {
    const response = await fetch(where, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(what),
    });
    const answer = await response.json();
    if (response.ok) find("answer").textContent = done(answer);
    else find("problem").textContent = `Refused${answer.by ? ` (${answer.by})` : ""}: ${answer.error}`;
  } catch {
    find("problem").textContent = "Not done: the robot's program does not answer.";
  }
}

async function busy(button, work) {
  button.disabled = true;
  await work();
  button.disabled = false;
  button.focus();
}

function onSubmit(id, what) {
  find(id).addEventListener("submit", (event) => {
    event.preventDefault();
    const fields = Object.fromEntries(new FormData(event.target));
    const message = (answer) => `${spoken(answer.written)} is in the robot's knowledge.`;
    busy(event.target.querySelector("button"), () => ask("orders", what(fields), message));
  });
}

onSubmit("provide", ({ area }) => ({ kind: "provide", area }));
onSubmit("deliver", ({ area, to }) => (to === "delivery" ? { kind: "collect", area } : { kind: "move", area, to }));

for (const button of document.querySelectorAll("button[name=load]")) {
  button.addEventListener("click", () =>
    busy(button, () => ask("load", { load: button.value }, () => `The container is marked ${button.value}.`)),
  );
}
