/** The chosen Lucide icons, put in by build.mjs: name -> the markup inside their <svg>. */
declare module 'virtual:icons' {
  const icons: Readonly<Record<string, string>>;
  export default icons;
}
