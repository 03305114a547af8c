// Description of a robot: a W3C Thing Description, from which NEP Studio creates blocks and forms.
import { NepError } from "../errors.js";
import type { Call } from "./call.js";
import { given, inputSchema, objectSchema, type Parameter, problemsOf, schemaOf, type Value } from "./schema.js";
import { BEAT_S } from "./tasks.js";
import { isMembers, type Members } from "./text.js";

const CONTEXT = ["https://www.w3.org/2022/wot/td/v1.1", { rb: "https://nep-studio.example/robot-blocks/v1#" }];
const NAME = /^[A-Za-z_][A-Za-z0-9_-]{0,63}$/;
const RESERVED = ["description", "command", "answer", "state", "world"];
const MAX_BYTES = 1_000_000;

/** Declaration of an action. */
export interface ActionSpec {
  /** Text of its block, with placeholders `%name` for parameters: `turn %angle °`. */
  readonly text: string;
  /** The text in the third person. */
  readonly says?: string;
  /** Heading in the toolbox, such as `Movement`. */
  readonly category: string;
  /** Name of a Lucide icon. */
  readonly icon: string;
  readonly title?: string;
  readonly description?: string;
  readonly parameters?: Readonly<Record<string, Parameter>>;
  /** Required resources, such as `motor`; a resource is used by one action at a time. */
  readonly uses?: readonly string[];
  /** What to do if a resource is in use: `queue` (default) waits, `replace` cancels the other action, `reject` fails. */
  readonly onBusy?: "queue" | "replace" | "reject";
  /** Time limit in seconds, after which the action fails. */
  readonly timeoutS?: number;
  /** `moves` or `locomotes` (leaves its place): Studio asks before the first such action. */
  readonly risk?: "moves" | "locomotes";
  /** False if the action can't be canceled. Default: true. */
  readonly cancellable?: boolean;
  /** For actions that leave the robot in motion, such as a speed: interval in seconds at which tools repeat it. */
  readonly repeatS?: number;
  /** Named values that `run` returns. */
  readonly output?: Readonly<Record<string, Value>>;
  /** Named values reported by `call.feedback`. */
  readonly feedback?: Readonly<Record<string, Value>>;
  /** RIZE primitive, such as `say`: its input becomes the first parameter, its options the parameters of the same names. */
  readonly rize?: string;
  /** Convert RIZE's input and options if the default conversion doesn't fit. Throws for invalid values. */
  fromRize?(input: string, options: Members): Members;
  /** Execute the action with validated input. Wait with `call.wait` or pass on `call.signal`, so that a stop ends it. */
  run(input: any, call: Call): unknown;
}

/** Declaration of a camera. */
export interface Camera {
  readonly type: "camera";
  readonly width: number;
  readonly height: number;
  /** Horizontal field of view in degrees. */
  readonly hfovDeg: number;
  readonly title?: string;
}

/** Declaration of a sensor: a value, an object (`fields`), or images of a camera. */
export type SensorSpec = (Value | Camera) & {
  /** Text of its block. */
  readonly text?: string;
  readonly icon?: string;
  readonly rateHz?: number;
};

/** Declaration of an event. */
export interface EventSpec {
  /** Text of its block: `when %robot bumps on the %side`. */
  readonly text: string;
  readonly title?: string;
  readonly icon: string;
  readonly fields?: Readonly<Record<string, Value>>;
  /** Fields that the block offers as a choice. */
  readonly choose?: readonly string[];
  /** Return a primitive and its inputs for RIZE's blackboard, such as `["bumpers", { left: 1 }]`. */
  rize?(data: Members): readonly [string, Members];
}

/** Declaration of the stop. */
export interface StopSpec {
  /** Name of the stop action. Default: `stop`. */
  readonly name?: string;
  /** Seconds without a message from the program that moves the robot, after which it stops. Default: 1. */
  readonly watchdogS?: number;
  /** Maximum seconds until the robot stands still. Default: 0.2. */
  readonly withinS?: number;
  /** Stop the robot and return once it stands still; throw `Failed` if that can't be guaranteed. */
  run(): unknown;
}

/** Declaration of a kind of robot. */
export interface RobotSpec {
  readonly model: string;
  readonly title: string;
  readonly description?: string;
  /** True for a simulated robot. */
  readonly virtual?: boolean;
  readonly kinds?: readonly string[];
  readonly actions: Readonly<Record<string, ActionSpec>>;
  readonly sensors?: Readonly<Record<string, SensorSpec>>;
  readonly events?: Readonly<Record<string, EventSpec>>;
  readonly stop: StopSpec;
  /** Disconnect from the robot; called when the driver exits. */
  close?(): unknown;
}

/** Action with defaults applied. */
export interface RobotAction {
  readonly name: string;
  readonly title: string;
  readonly parameters: Readonly<Record<string, Parameter>>;
  readonly output: Readonly<Record<string, Value>> | undefined;
  readonly uses: readonly string[];
  readonly onBusy: "queue" | "replace" | "reject";
  readonly timeoutS: number | undefined;
  readonly repeatS: number | undefined;
  readonly cancellable: boolean;
  run(input: any, call: Call): unknown;
}

/** Description of a robot in the form that the driver needs. */
export interface Description {
  readonly name: string;
  readonly document: Members;
  readonly actions: ReadonlyMap<string, RobotAction>;
  readonly stopAction: string;
}

/** Return the topic of a sensor or another part of a robot, such as `/My_robot/camera`. */
export function topicOf(name: string, leaf: string): string {
  return `/${name.replace(/[^\p{L}\p{N}_.-]/gu, "_")}/${leaf}`;
}

/** Return the description of a robot with this declaration and name. @throws {NepError} if the declaration is invalid. */
export function describe(spec: RobotSpec, name: string): Description {
  const stopAction = spec.stop.name ?? "stop";
  checkNames(spec, stopAction);
  const actions = new Map(Object.entries(spec.actions).map(([each, action]) => [each, withDefaults(each, action)]));
  const document = documentOf(spec, name, stopAction);
  if (JSON.stringify(document).length > MAX_BYTES) throw new NepError(`${name}: its description is larger than 1 MB.`);
  return { name, document, actions, stopAction };
}

function checkNames({ actions, sensors = {}, events = {}, model }: RobotSpec, stopAction: string): void {
  const names = [model, stopAction, ...Object.keys(actions), ...Object.keys(sensors), ...Object.keys(events)];
  for (const each of names) {
    if (!NAME.test(each)) throw new NepError(`Invalid name "${each}". Use letters, digits, - and _ without spaces.`);
  }
  if (Object.hasOwn(actions, stopAction))
    throw new NepError(`"${stopAction}" is the name of the stop; choose another name for the action.`);
  for (const each of [...Object.keys(sensors), ...Object.keys(events)]) {
    if (RESERVED.includes(each) || (Object.hasOwn(sensors, each) && Object.hasOwn(events, each)))
      throw new NepError(`The name "${each}" is used twice or reserved; the topics would be the same.`);
  }
}

function checkAction(name: string, { text, says = "", parameters = {} }: ActionSpec): void {
  for (const [, used] of `${text} ${says}`.matchAll(/%([A-Za-z_][\w-]*)/g)) {
    if (used !== "robot" && !Object.hasOwn(parameters, used!))
      throw new NepError(`${name}: the text contains %${used}, which is not a parameter.`);
  }
  for (const [each, parameter] of Object.entries(parameters)) {
    if (!NAME.test(each) || each === "robot") throw new NepError(`${name}: invalid parameter name "${each}".`);
    if (parameter.default === undefined) continue;
    const [problem] = problemsOf({ [each]: parameter }, { [each]: parameter.default });
    if (problem) throw new NepError(`${name}: invalid default: ${problem}.`);
  }
}

function withDefaults(name: string, action: ActionSpec): RobotAction {
  checkAction(name, action);
  const { title = name.replaceAll("_", " "), parameters = {}, uses = [], onBusy = "queue" } = action;
  const { output, timeoutS, repeatS, cancellable = true } = action;
  const run = (input: unknown, call: Call): unknown => action.run(input, call);
  return { name, title, parameters, output, uses, onBusy, timeoutS, repeatS, cancellable, run };
}

function documentOf(spec: RobotSpec, name: string, stopAction: string): Members {
  const { model, title, virtual = false, kinds = [], stop } = spec;
  const topics = ["description", "command", "answer", ...(virtual ? ["state", "world"] : [])];
  return given({
    "@context": CONTEXT,
    "@type": ["rb:Robot"],
    id: `urn:nep:robot:${topicOf(name, "").slice(1, -1)}`,
    title: name,
    description: spec.description || undefined,
    version: { instance: "1.0.0", model: "1.0.0" },
    securityDefinitions: { nosec_sc: { scheme: "nosec" } },
    security: "nosec_sc",
    "rb:profile": 1,
    "rb:robot": { model, title, virtual, kinds, driver: "javascript", dialect: "native" },
    "rb:topics": Object.fromEntries(topics.map((leaf) => [leaf, topicOf(name, leaf)])),
    "rb:resources": [...new Set(Object.values(spec.actions).flatMap(({ uses = [] }) => uses))],
    "rb:beat": BEAT_S,
    "rb:safeStop": {
      action: stopAction,
      watchdog: stop.watchdogS ?? 1,
      within: stop.withinS ?? 0.2,
      onProgramEnd: true,
      onDisconnect: true,
      confirmed: true,
    },
    properties: mapped(spec.sensors ?? {}, (leaf, each) => sensorPart(leaf, each, topicOf(name, leaf))),
    actions: {
      ...mapped(spec.actions, (leaf, each) => ({ ...actionPart(leaf, each), forms: [commandForm(name)] })),
      [stopAction]: { ...stopPart(), forms: [commandForm(name)] },
    },
    events: mapped(spec.events ?? {}, (leaf, each) => ({
      ...eventPart(leaf, each),
      forms: [form(topicOf(name, leaf), "subscribeevent", "unsubscribeevent")],
    })),
  });
}

function mapped<T>(given: Readonly<Record<string, T>>, part: (name: string, each: T) => Members): Members {
  return Object.fromEntries(Object.entries(given).map(([name, each]) => [name, part(name, each)]));
}

function actionPart(name: string, action: ActionSpec): Members {
  const { title = name.replaceAll("_", " "), text, says, category, icon, cancellable = true } = action;
  return given({
    title,
    description: action.description,
    synchronous: !cancellable,
    input: inputSchema(action.parameters ?? {}),
    output: action.output && objectSchema(action.output),
    "rb:feedback": action.feedback && objectSchema(action.feedback),
    "rb:cancel": cancellable,
    "rb:uses": action.uses ?? [],
    "rb:onBusy": action.onBusy ?? "queue",
    "rb:timeout": action.timeoutS,
    "rb:risk": action.risk,
    "rb:repeat": action.repeatS,
    "rb:block": given({ category, icon, text: { en: text }, says: says && { en: says } }),
  });
}

function stopPart(): Members {
  const block = { category: "Movement", icon: "octagon-x", text: { en: "stop moving" }, says: { en: "stops" } };
  return { title: "stop", synchronous: true, idempotent: true, "rb:cancel": false, "rb:uses": [], "rb:block": block };
}

function sensorPart(name: string, sensor: SensorSpec, topic: string): Members {
  const { text, icon, rateHz } = sensor;
  const observed = form(topic, "observeproperty", "unobserveproperty");
  const isCamera = sensor.type === "camera";
  return given({
    ...(isCamera ? cameraPart(name, sensor) : schemaOf(name, sensor)),
    readOnly: true,
    observable: true,
    "rb:rate": rateHz,
    "rb:block": given({
      category: "Sensors",
      icon: icon ?? (isCamera ? "camera" : "activity"),
      text: text && { en: text },
    }),
    forms: [isCamera ? { ...observed, contentType: "image/jpeg" } : observed],
  });
}

function cameraPart(name: string, camera: Camera): Members {
  return {
    title: camera.title ?? name.replaceAll("_", " "),
    type: "string",
    contentEncoding: "base64",
    contentMediaType: "image/jpeg",
    "rb:widget": "image",
    "rb:image": { width: camera.width, height: camera.height, hfov: camera.hfovDeg },
  };
}

function eventPart(name: string, event: EventSpec): Members {
  return {
    title: event.title ?? name.replaceAll("_", " "),
    data: objectSchema(event.fields ?? {}),
    "rb:filter": event.choose ?? [],
    "rb:block": { category: "Events", icon: event.icon, text: { en: event.text } },
  };
}

function form(topic: string, ...op: string[]): Members {
  return { href: `nep:${topic}`, contentType: "application/json", op };
}

function commandForm(name: string): Members {
  const asked = form(topicOf(name, "command"), "invokeaction", "cancelaction");
  return { ...asked, "rb:answer": `nep:${topicOf(name, "answer")}` };
}

/** Return the payload for a sensor's value. @throws {NepError} if the value doesn't match the sensor's type. */
export function sensedValue(name: string, sensor: SensorSpec, value: unknown): unknown {
  if (sensor.type === "camera") return value;
  const [problem] = problemsOf({ value: { ...sensor, title: "the value" } }, { value: value ?? null });
  if (problem) throw new NepError(`Sensor "${name}": ${problem}.`);
  return sensor.type === "object" && isMembers(value) ? value : { value };
}
