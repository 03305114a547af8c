// Conversion of declared values to data schemas of a robot's description, and validation.
import { NepError } from "../errors.js";
import { isMembers, type Members } from "./text.js";

/** Declaration of a value of an action, a sensor or an event. */
export interface Value {
  readonly type: "number" | "integer" | "boolean" | "string" | "colour" | "image" | "list" | "object";
  /** Label in forms. Default: the name. */
  readonly title?: string;
  readonly minimum?: number;
  readonly maximum?: number;
  /** Step in editors. */
  readonly step?: number;
  /** Unit in UCUM notation: `m`, `deg`, `s`, `m/s`, `%`. */
  readonly unit?: string;
  /** Widget in forms; `angle` is a dial. */
  readonly widget?: string;
  /** Allowed values, or a map from allowed values to their labels. */
  readonly choices?: readonly (string | number)[] | Readonly<Record<string, string>>;
  /** Minimum number of characters of a text or values of a list. */
  readonly minLength?: number;
  readonly maxLength?: number;
  /** Declaration of each value of a list. */
  readonly items?: Value;
  /** Named values of an object. */
  readonly fields?: Readonly<Record<string, Value>>;
}

/** Declaration of a parameter of an action. Required unless it has a default or is optional. */
export interface Parameter extends Value {
  readonly default?: unknown;
  /** True if it may be omitted or null. */
  readonly optional?: boolean;
  /** Initial value in forms; the parameter remains required. */
  readonly suggested?: unknown;
  /** Collapsed in forms. */
  readonly advanced?: boolean;
}

const TYPES = { colour: "string", image: "string", list: "array" } as const;
const UNIT_WORDS: Readonly<Record<string, string>> = {
  degree: "deg",
  degrees: "deg",
  "°": "deg",
  meter: "m",
  meters: "m",
  metres: "m",
  second: "s",
  seconds: "s",
  percent: "%",
};

/** Return the schema of a value. @throws {NepError} for an unknown unit. */
export function schemaOf(name: string, value: Value | Parameter): Members {
  checkUnit(name, value.unit);
  const isList = value.type === "list";
  return given({
    title: value.title ?? name.replaceAll("_", " "),
    type: value.choices ? undefined : ((TYPES as Record<string, string>)[value.type] ?? value.type),
    ...choicesOf(value),
    minimum: value.minimum,
    maximum: value.maximum,
    [value.type === "integer" ? "multipleOf" : "rb:step"]: value.step,
    unit: value.unit,
    [isList ? "minItems" : "minLength"]: value.minLength || undefined,
    [isList ? "maxItems" : "maxLength"]: value.maxLength,
    items: value.items && schemaOf("value", value.items),
    ...(value.fields && objectSchema(value.fields)),
    "rb:widget": value.widget,
    ...(value.type === "colour" && { pattern: "^#[0-9a-fA-F]{6}$", "rb:widget": "colour" }),
    ...(value.type === "image" && {
      format: "uri-reference",
      contentMediaType: "image/jpeg",
      "rb:widget": "image",
    }),
    ...parameterPart(value),
  });
}

function parameterPart(value: Parameter): Members {
  return {
    default: value.default ?? value.suggested,
    "rb:nullable": value.optional || undefined,
    "rb:advanced": value.advanced || undefined,
  };
}

function choicesOf({ type, choices }: Value): Members {
  if (!choices) return {};
  if (Array.isArray(choices)) {
    const isText = choices.every((each) => typeof each === "string");
    return { type: isText ? "string" : "number", enum: choices };
  }
  const isNumber = type === "number" || type === "integer";
  const oneOf = Object.entries(choices).map(([value, title]) => ({ const: isNumber ? Number(value) : value, title }));
  return { type: isNumber ? "number" : "string", oneOf };
}

/** Return the schema of an object with these fields. */
export function objectSchema(fields: Readonly<Record<string, Value | Parameter>>): Members {
  const entries = Object.entries(fields);
  const properties = Object.fromEntries(entries.map(([name, each]) => [name, schemaOf(name, each)]));
  return { type: "object", properties };
}

/** Return the schema of an action's input; undefined without parameters. */
export function inputSchema(parameters: Readonly<Record<string, Parameter>>): Members | undefined {
  const entries = Object.entries(parameters);
  if (entries.length === 0) return undefined;
  const required = entries.filter(([, each]) => isRequired(each)).map(([name]) => name);
  return given({ ...objectSchema(parameters), required: required.length > 0 ? required : undefined });
}

/** Return true if a parameter is required. */
export function isRequired(parameter: Parameter): boolean {
  return parameter.default === undefined && !parameter.optional;
}

/** Return the members that are not undefined. */
export function given(members: Members): Members {
  return Object.fromEntries(Object.entries(members).filter(([, value]) => value !== undefined));
}

function checkUnit(name: string, unit: string | undefined): void {
  if (unit === undefined) return;
  const sign = UNIT_WORDS[unit.toLowerCase()];
  if (sign !== undefined) throw new NepError(`${name}: unknown unit "${unit}"; write "${sign}".`);
  if (!/^[!-~µ²³]{1,16}$/u.test(unit))
    throw new NepError(`${name}: unknown unit "${unit}"; use UCUM, such as "m", "deg" or "m/s".`);
}

// ---- validation

/** Return an error message for each invalid or missing value of an input; empty if the input is valid. */
export function problemsOf(parameters: Readonly<Record<string, Parameter>>, input: unknown): string[] {
  if (!isMembers(input)) return ["the input must be an object with named values"];
  const unknown = Object.keys(input).filter((name) => !Object.hasOwn(parameters, name));
  const problems = unknown.slice(0, 5).map((name) => `unknown name “${quotedName(name)}”`);
  if (unknown.length > 5) problems.push(`${unknown.length - 5} more names are unknown`);
  for (const [name, parameter] of Object.entries(parameters)) {
    const place = parameter.title ?? name.replaceAll("_", " ");
    if (!Object.hasOwn(input, name)) {
      if (isRequired(parameter)) problems.push(`${place} is missing`);
    } else if (!(input[name] === null && parameter.optional)) {
      const problem = problemOf(parameter, input[name], place);
      if (problem) problems.push(problem);
    }
  }
  return problems;
}

function quotedName(name: string): string {
  return name.length > 200 ? `${name.slice(0, 200)}…` : name;
}

function problemOf(value: Value, found: unknown, place: string): string | undefined {
  if (value.choices) return problemOfChoice(value, found, place);
  switch (value.type) {
    case "number":
    case "integer":
      return problemOfNumber(value, found, place);
    case "boolean":
      return typeof found === "boolean" ? undefined : `${place} must be yes or no`;
    case "colour":
      if (typeof found === "string" && /^#[0-9a-fA-F]{6}$/.test(found)) return undefined;
      return `${place} must be a colour like #20c0e0`;
    case "list":
      return problemOfList(value, found, place);
    case "object":
      return problemOfObject(value, found, place);
    default:
      return problemOfText(value, found, place);
  }
}

function problemOfChoice({ type, choices }: Value, found: unknown, place: string): string | undefined {
  const isNumber = type === "number" || type === "integer";
  const known = Array.isArray(choices)
    ? choices
    : Object.keys(choices ?? {}).map((each) => (isNumber ? Number(each) : each));
  return known.includes(found as string) ? undefined : `${place} must be ${known.join(" or ")}`;
}

function problemOfNumber({ type, minimum, maximum, unit }: Value, found: unknown, place: string): string | undefined {
  if (typeof found !== "number" || !Number.isFinite(found) || (type === "integer" && !Number.isInteger(found)))
    return `${place} must be a ${type === "integer" ? "whole number" : "number"}`;
  if (found >= (minimum ?? -Infinity) && found <= (maximum ?? Infinity)) return undefined;
  const shown = unit === undefined ? "" : ` ${unit === "deg" ? "°" : unit}`;
  if (minimum !== undefined && maximum !== undefined)
    return `${place} must be between ${minimum} and ${maximum}${shown}`;
  return minimum !== undefined
    ? `${place} must be at least ${minimum}${shown}`
    : `${place} must be at most ${maximum}${shown}`;
}

function problemOfLength({ minLength = 0, maxLength = Infinity }: Value, length: number): string | undefined {
  if (length < minLength) return `at least ${minLength}`;
  return length > maxLength ? `at most ${maxLength}` : undefined;
}

function problemOfText(value: Value, found: unknown, place: string): string | undefined {
  if (typeof found !== "string") return `${place} must be text`;
  const limit = problemOfLength(value, [...found].length);
  return limit && `${place} must have ${limit} characters`;
}

function problemOfList(value: Value, found: unknown, place: string): string | undefined {
  if (!Array.isArray(found)) return `${place} must be a list`;
  const limit = problemOfLength(value, found.length);
  if (limit) return `${place} must have ${limit} values`;
  if (!value.items) return undefined;
  for (const [at, each] of found.entries()) {
    const problem = problemOf(value.items, each, `${place} value ${at + 1}`);
    if (problem) return problem;
  }
  return undefined;
}

function problemOfObject({ fields }: Value, found: unknown, place: string): string | undefined {
  if (!isMembers(found)) return `${place} must be an object with named values`;
  if (!fields) return undefined;
  const unknown = Object.keys(found).find((name) => !Object.hasOwn(fields, name));
  if (unknown !== undefined) return `${place} has no “${quotedName(unknown)}”`;
  for (const [name, field] of Object.entries(fields)) {
    const problem = Object.hasOwn(found, name) && problemOf(field, found[name], `${place} ${name}`);
    if (problem) return problem;
  }
  return undefined;
}
