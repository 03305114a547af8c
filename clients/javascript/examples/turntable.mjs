// A robot: node turntable.mjs --name Table. NEP Studio shows its blocks, forms and sensor, and can stop it.
import { Robot } from "nep-js/robot";

let degrees = 0; // connect to the motor here

const robot = new Robot({
  model: "turntable",
  title: "Turntable",
  sensors: {
    angle: { type: "number", minimum: 0, maximum: 360, unit: "deg", text: "angle", icon: "compass" },
  },
  actions: {
    turn: {
      text: "turn %angle °", category: "Movement", icon: "rotate-ccw",
      description: "Turn, to the left when positive.",
      uses: ["motor"], onBusy: "replace", risk: "moves",
      parameters: {
        angle: { type: "number", minimum: -360, maximum: 360, step: 5, unit: "deg", widget: "angle", default: 90 },
      },
      async run({ angle }, call) {
        for (let n = 0; n < Math.round(Math.abs(angle)); n++) {
          await call.wait(0.01); // rejects when the action is canceled
          degrees = (degrees + (angle > 0 ? 1 : 359)) % 360; // move the motor here
          robot.sense("angle", degrees);
        }
      },
    },
    blink: {
      text: "blink %times times", category: "Lights", icon: "lightbulb", uses: ["lamp"], timeoutS: 10,
      parameters: { times: { type: "integer", minimum: 1, maximum: 20, default: 3 } },
      async run({ times }, call) {
        for (let n = 0; n < 2 * times; n++) await call.wait(0.1); // switch the lamp here
      },
    },
  },
  stop: { watchdogS: 1, withinS: 0.2, run() {} }, // hold the motor here; the actions have been canceled
});

await robot.main();
