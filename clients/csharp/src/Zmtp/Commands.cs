using System;
using System.Collections.Generic;
using System.Text;

namespace Nep.Zmtp
{
    /// <summary>Bodies of commands: the length of the name, the name, and data.</summary>
    internal static class Commands
    {
        private const int MaxProperties = 32;

        public static byte[] Name(string name)
        {
            var body = new byte[name.Length + 1];
            body[0] = (byte)name.Length;
            Encoding.ASCII.GetBytes(name, 0, name.Length, body, 1);
            return body;
        }

        public static bool Is(byte[] body, string name)
        {
            if (body.Length < name.Length + 1 || body[0] != name.Length)
            {
                return false;
            }
            for (int i = 0; i < name.Length; i++)
            {
                if (body[i + 1] != name[i])
                {
                    return false;
                }
            }
            return true;
        }

        public static byte[] Ping(int timeoutMs)
        {
            int tenths = Math.Min(65535, timeoutMs / 100);
            byte[] name = Name("PING");
            var body = new byte[name.Length + 2];
            Buffer.BlockCopy(name, 0, body, 0, name.Length);
            body[name.Length] = (byte)(tenths >> 8);
            body[name.Length + 1] = (byte)tenths;
            return body;
        }

        /// <summary>Return the PONG for a PING, with its context.</summary>
        public static byte[] Pong(byte[] ping)
        {
            byte[] name = Name("PONG");
            int context = Math.Max(0, Math.Min(16, ping.Length - 7));
            var body = new byte[name.Length + context];
            Buffer.BlockCopy(name, 0, body, 0, name.Length);
            if (context > 0)
            {
                Buffer.BlockCopy(ping, 7, body, name.Length, context);
            }
            return body;
        }

        /// <summary>Return the text of an ERROR, with control characters replaced.</summary>
        public static string ErrorReason(byte[] body)
        {
            if (body.Length < 7)
            {
                return "no reason";
            }
            int count = Math.Min(body[6], body.Length - 7);
            char[] text = Encoding.ASCII.GetString(body, 7, count).ToCharArray();
            return new string(Array.ConvertAll(text, each => char.IsControl(each) ? '?' : each));
        }

        public static void ReadProperties(byte[] body, int at, IDictionary<string, byte[]> into)
        {
            while (at < body.Length)
            {
                int nameSize = body[at];
                int valueAt = at + 1 + nameSize + 4;
                if (nameSize == 0 || valueAt > body.Length || into.Count >= MaxProperties)
                {
                    throw new ZmtpException("bad-handshake", "it sent a malformed handshake");
                }
                string name = Encoding.ASCII.GetString(body, at + 1, nameSize);
                long size = 0;
                for (int i = valueAt - 4; i < valueAt; i++)
                {
                    size = size << 8 | body[i];
                }
                if (size > body.Length - valueAt)
                {
                    throw new ZmtpException("bad-handshake", "it sent a malformed handshake");
                }
                var value = new byte[(int)size];
                Buffer.BlockCopy(body, valueAt, value, 0, value.Length);
                into[name] = value;
                at = valueAt + value.Length;
            }
        }
    }
}
