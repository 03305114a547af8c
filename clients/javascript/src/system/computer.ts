import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { hostname } from "node:os";

const REGISTRY_KEY = "HKLM\\SOFTWARE\\Microsoft\\Cryptography";
let known: string | undefined;

/** Return an id of the running system, 16 hexadecimal digits, equal for all of its programs; "" if unknown. */
export function computerId(): string {
  known ??= digitsOf(clockName());
  return known;
}

function digitsOf(name: string): string {
  return name && createHash("sha256").update(`nep clock ${name}`, "utf8").digest("hex").slice(0, 16);
}

/** Return a name of the running system, as nep for Python does; "" if unknown. */
function clockName(): string {
  try {
    switch (process.platform) {
      case "linux":
        return readFileSync("/proc/sys/kernel/random/boot_id", "ascii").trim();
      case "darwin":
        return said("sysctl", "-n", "kern.bootsessionuuid");
      case "win32":
        return `${said("reg", "query", REGISTRY_KEY, "/v", "MachineGuid", "/reg:64").split(/\s+/).at(-1)!} ${hostname()}`;
      default:
        return "";
    }
  } catch {
    return "";
  }
}

function said(command: string, ...words: string[]): string {
  return execFileSync(command, words, { encoding: "utf8", timeout: 2000, windowsHide: true }).trim();
}
