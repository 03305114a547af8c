using System;
using System.Text;

namespace Nep.Zmtp
{
    /// <summary>Greeting: the first 64 bytes of a connection (ZMTP 3.0, section "Greeting").</summary>
    internal static class Greeting
    {
        public const int Size = 64;
        public const int SignatureSize = 10;
        private const int MechanismAt = 12;
        private const int MechanismBytes = 20;
        private const int AsServerAt = 32;

        public static byte[] Create(string mechanism, bool isServer)
        {
            var greeting = new byte[Size];
            greeting[0] = 0xFF;
            greeting[9] = 0x7F;
            greeting[10] = 3; // 3.0, so that libzmq sends subscriptions as messages
            Encoding.ASCII.GetBytes(mechanism, 0, mechanism.Length, greeting, MechanismAt);
            greeting[AsServerAt] = isServer ? (byte)1 : (byte)0;
            return greeting;
        }

        /// <summary>Check the first <paramref name="count"/> bytes of a peer's greeting.</summary>
        /// <exception cref="ZmtpException">It isn't a greeting of ZMTP 3, or has another mechanism.</exception>
        public static void Check(byte[] greeting, int count, string mechanism)
        {
            if (count >= 1 && greeting[0] != 0xFF || count >= 10 && (greeting[9] & 1) != 1)
            {
                throw new ZmtpException("no-greeting", "it does not speak ZMTP");
            }
            if (count >= 11 && greeting[10] < 3)
            {
                throw new ZmtpException("old-version", "it speaks a version of ZMTP before 3");
            }
            if (count < Size)
            {
                return;
            }
            int end = MechanismAt;
            while (end < MechanismAt + MechanismBytes && greeting[end] != 0)
            {
                end++;
            }
            string theirs = Encoding.ASCII.GetString(greeting, MechanismAt, end - MechanismAt);
            if (theirs != mechanism)
            {
                bool isKnown = Array.IndexOf(new[] { "NULL", "PLAIN", "CURVE", "GSSAPI" }, theirs) >= 0;
                throw new ZmtpException("other-mechanism", "it uses " + (isKnown ? "the security mechanism " + theirs : "an unknown security mechanism"));
            }
        }
    }
}
