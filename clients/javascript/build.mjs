// Adds the ES module entry to what tsc built. It re-exports the CommonJS build instead of being a second one,
// so a program that uses both `import` and `require` has one set of classes.
import { writeFileSync } from "node:fs";

const dist = new URL("dist/", import.meta.url);
const entry = 'export * from "./index.js";\nexport { default } from "./index.js";\n';
writeFileSync(new URL("index.mjs", dist), entry);
writeFileSync(new URL("index.d.mts", dist), entry);
