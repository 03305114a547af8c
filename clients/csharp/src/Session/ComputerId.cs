using System;
using System.IO;
using System.Net;
using System.Runtime.InteropServices;
using System.Text;
using Nep.Wire;

namespace Nep.Session
{
    /// <summary>Id of the running system: programs with the same id use the same clock.</summary>
    internal static class ComputerId
    {
        private const string BootIdFile = "/proc/sys/kernel/random/boot_id";
        private const uint RegistryText = 2;
        private static readonly IntPtr LocalMachine = new IntPtr(unchecked((int)0x80000002));
        private static string _id;

        /// <summary>Return 16 hexadecimal digits, the same as in nep for Python; empty if unknown.</summary>
        public static string Get()
        {
            if (_id == null)
            {
                string name;
                try
                {
                    name = NameOfClock();
                }
                catch (Exception) // not available on this platform, or permission denied
                {
                    name = "";
                }
                _id = name.Length == 0 ? "" : Ids.NodeId("nep clock " + name);
            }
            return _id;
        }

        private static string NameOfClock()
        {
            if (RuntimeInformation.IsOSPlatform(OSPlatform.Windows))
            {
                var value = new StringBuilder(256);
                uint size = 512;
                int failed = RegGetValue(LocalMachine, @"SOFTWARE\Microsoft\Cryptography", "MachineGuid", RegistryText, IntPtr.Zero, value, ref size);
                return failed != 0 ? "" : value + " " + Dns.GetHostName();
            }
            if (RuntimeInformation.IsOSPlatform(OSPlatform.OSX))
            {
                var value = new byte[64];
                var size = new IntPtr(value.Length);
                int failed = SysctlByName("kern.bootsessionuuid", value, ref size, IntPtr.Zero, IntPtr.Zero);
                return failed != 0 ? "" : Encoding.ASCII.GetString(value).TrimEnd('\0');
            }
            return File.ReadAllText(BootIdFile).Trim();
        }

        [DllImport("advapi32", EntryPoint = "RegGetValueW", CharSet = CharSet.Unicode)]
        private static extern int RegGetValue(IntPtr key, string path, string name, uint flags, IntPtr type, StringBuilder value, ref uint size);

        [DllImport("libc", EntryPoint = "sysctlbyname", CharSet = CharSet.Ansi)]
        private static extern int SysctlByName(string name, byte[] value, ref IntPtr size, IntPtr newValue, IntPtr newSize);
    }
}
