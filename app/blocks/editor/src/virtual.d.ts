/** Lucide icons, inserted by build.mjs: maps a name to the markup inside its <svg>. */
declare module 'virtual:icons' {
  const icons: Readonly<Record<string, string>>;
  export default icons;
}
