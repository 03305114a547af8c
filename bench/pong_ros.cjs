// Pong of the row "rospy with rosnodejs" (bench/paper_ends.py): decodes each message and publishes it again.
//
//     node bench/pong_ros.cjs PACKAGE KINDS HOST ROS_MASTER    KINDS is a JSON list
//
// PACKAGE is the folder of rosnodejs. It reads message definitions from $ROS_PACKAGE_PATH.
"use strict";

const net = require("node:net");
const [packagePath, kinds, host, master] = process.argv.slice(2);

const { listen } = net.Server.prototype;
net.Server.prototype.listen = function (port, ...others) {
  // rosnodejs listens at all addresses of the computer.
  return listen.call(this, port, host, ...others.filter((each) => typeof each === "function"));
};
Object.assign(process.env, { CMAKE_PREFIX_PATH: "/", ROS_MASTER_URI: master, ROS_IP: host });

const { run } = require("./pong_lines.cjs");
const rosnodejs = require(packagePath);

const IMMEDIATELY = { queueSize: 10, throttleMs: -1, tcpNoDelay: true };

run(async (_other, echoed) => {
  const node = await rosnodejs.initNode("/pong", { onTheFly: true, rosMasterUri: master });
  for (const kind of JSON.parse(kinds)) {
    const type = kind === "bytes" ? "std_msgs/UInt8MultiArray" : "std_msgs/String";
    const layout = kind === "bytes" ? { layout: { dim: [], data_offset: 0 } } : {};
    const decode = kind === "json" ? JSON.parse : (data) => data;
    const encode = kind === "json" ? JSON.stringify : (data) => data;
    const publisher = node.advertise(`/rosnodejs_pong_${kind}`, type, IMMEDIATELY);
    const onMessage = ({ data }) => {
      publisher.publish({ ...layout, data: encode(decode(data)) });
      echoed(kind);
    };
    node.subscribe(`/rosnodejs_ping_${kind}`, type, onMessage, IMMEDIATELY);
  }
});
