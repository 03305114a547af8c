export { Call, Canceled, Failed } from "./call.js";
export { type Clock, ManualClock } from "./clock.js";
export type { ActionSpec, Camera, EventSpec, RobotSpec, SensorSpec, StopSpec } from "./description.js";
export { Robot, type StartOptions } from "./robot.js";
export type { Parameter, Value } from "./schema.js";
