using System;
using System.Globalization;
using System.Security.Cryptography;
using System.Text;

namespace Nep.Wire
{
    /// <summary>Ids derived from a node's key: see docs/wire.md, "Node identity".</summary>
    internal static class Ids
    {
        public static string NewKey()
        {
            return Guid.NewGuid().ToString("N"); // from the system's cryptographic generator
        }

        public static string NodeId(string key)
        {
            byte[] digest = Digest(key);
            var text = new StringBuilder();
            for (int i = 0; i < 8; i++)
            {
                text.Append(digest[i].ToString("x2", CultureInfo.InvariantCulture));
            }
            return text.ToString();
        }

        public static ulong Id(string key, long number)
        {
            byte[] digest = Digest(key + "/" + number.ToString(CultureInfo.InvariantCulture));
            ulong id = LittleEndian.Read(digest, 0, 8) >> 1;
            return id == 0 ? 1 : id;
        }

        private static byte[] Digest(string text)
        {
            // SHA256.Create finds its class by reflection, and IL2CPP's linker may have removed it.
            using (var hash = new SHA256Managed())
            {
                return hash.ComputeHash(Encoding.UTF8.GetBytes(text));
            }
        }
    }
}
