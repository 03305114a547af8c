// roslib 2 as its examples use it, driven by a test over its pipes: see python_peer.py.
import * as ROSLIB from "roslib";
import { createInterface } from "readline";

const say = (value) => process.stdout.write("\x1e" + JSON.stringify(value) + "\n");
const ros = new ROSLIB.Ros({ url: process.argv[2] });
ros.on("error", (error) => say({ error: String(error) }));
ros.on("connection", () => say("ready"));
ros.on("close", () => process.exit(0));

const answered = (call, ...given) => new Promise((resolve, reject) => call.call(ros, ...given, resolve, reject));
const topic = (name, messageType, rest = {}) => new ROSLIB.Topic({ ros, name, messageType, ...rest });
const service = (name, serviceType) => new ROSLIB.Service({ ros, name, serviceType });
const got = (value) => say({ got: value });

const steps = {
  listen: ([name, type, rest]) => topic(name, type, rest).subscribe(got),
  talk: ([name, type, msg, rest]) => topic(name, type, rest).publish(msg),
  kind: ([name, type, field]) =>
    topic(name, type, { compression: "cbor" }).subscribe((msg) => got([msg[field].constructor.name, [...msg[field]]])),
  call: ([name, args]) => service(name, "").callService(args, got, (reason) => got({ failed: String(reason) })),
  serve: ([name]) =>
    service(name, "std_srvs/SetBool").advertise((request, response) => {
      response.success = request.data;
      response.message = "set";
      return request.data;
    }),
  ask: async ([method, ...given]) => got(await answered(ros[method], ...given)),
  getParam: ([name]) => new ROSLIB.Param({ ros, name }).get(got, (reason) => got({ failed: reason })),
  setParam: ([name, value]) => new ROSLIB.Param({ ros, name }).set(value, () => got("set"), (reason) => got({ failed: reason })),
};
createInterface({ input: process.stdin }).on("line", (line) => {
  const [step, ...given] = JSON.parse(line);
  steps[step](given);
});
