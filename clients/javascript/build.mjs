// Adds ES module entries to the output of tsc. They re-export the CommonJS build, so that a program that uses both
// `import` and `require` has one set of classes.
import { writeFileSync } from "node:fs";

const named = 'export * from "./index.js";\n';
const entries = { "dist/": `${named}export { default } from "./index.js";\n`, "dist/robot/": named };
for (const [folder, entry] of Object.entries(entries)) {
  for (const file of ["index.mjs", "index.d.mts"]) writeFileSync(new URL(folder + file, import.meta.url), entry);
}
