using System.Globalization;
using System.Text;

namespace Nep.Wire
{
    /// <summary>Content of a hello filter.</summary>
    internal struct Hello
    {
        public ulong Subscriber;
        public string Topic;
        public int Level;
    }

    /// <summary>Content of an acknowledgement.</summary>
    internal struct ReadAnswer
    {
        public ulong Subscriber;
        public ulong Publisher;
        public ulong Seq;
        public ulong BoundBytes;
    }

    /// <summary>Filters that begin with <c>ff</c>: hello, read and shares.</summary>
    internal static class Filters
    {
        private static readonly string[] HelloNames = { "hello/", "hello1/", "hello2/", "hello3/" };

        public static byte[] Hello(ulong subscriber, string topic, int level)
        {
            byte[] text = Encoding.UTF8.GetBytes(HelloNames[level] + Hex(subscriber) + "/" + topic);
            return WithMark(text);
        }

        public static byte[] Read(ReadAnswer answer)
        {
            string text = "read/" + Hex(answer.Subscriber) + "/" + Hex(answer.Publisher) + "/" + Hex(answer.Seq) + "/" + Hex(answer.BoundBytes);
            return WithMark(Encoding.ASCII.GetBytes(text));
        }

        public static bool TryParseHello(byte[] filter, out Hello hello)
        {
            hello = new Hello();
            for (int level = 0; level < HelloNames.Length; level++)
            {
                string name = HelloNames[level];
                int at = 1 + name.Length;
                if (!HasName(filter, name) || filter.Length < at + 17 || filter[at + 16] != (byte)'/')
                {
                    continue;
                }
                if (!TryHex(filter, at, out hello.Subscriber))
                {
                    return false;
                }
                try
                {
                    hello.Topic = Names.StrictUtf8.GetString(filter, at + 17, filter.Length - at - 17);
                }
                catch (DecoderFallbackException)
                {
                    return false;
                }
                hello.Level = level;
                return true;
            }
            return false;
        }

        public static bool TryParseRead(byte[] filter, out ReadAnswer answer)
        {
            answer = new ReadAnswer();
            return HasName(filter, "read/") && filter.Length == 6 + 4 * 17 - 1
                && TryHex(filter, 6, out answer.Subscriber) && filter[22] == (byte)'/'
                && TryHex(filter, 23, out answer.Publisher) && filter[39] == (byte)'/'
                && TryHex(filter, 40, out answer.Seq) && filter[56] == (byte)'/'
                && TryHex(filter, 57, out answer.BoundBytes);
        }

        /// <summary>Return true if a filter accepts an offer of shared memory, which this library never sends.</summary>
        public static bool IsShares(byte[] filter)
        {
            ulong number;
            return HasName(filter, "shares/") && filter.Length == 8 + 3 * 17 - 1
                && TryHex(filter, 8, out number) && filter[24] == (byte)'/'
                && TryHex(filter, 25, out number) && filter[41] == (byte)'/'
                && TryHex(filter, 42, out number);
        }

        private static string Hex(ulong number)
        {
            return number.ToString("x16", CultureInfo.InvariantCulture);
        }

        private static byte[] WithMark(byte[] text)
        {
            var filter = new byte[text.Length + 1];
            filter[0] = 0xFF;
            text.CopyTo(filter, 1);
            return filter;
        }

        private static bool HasName(byte[] filter, string name)
        {
            if (filter.Length < name.Length + 1 || filter[0] != 0xFF)
            {
                return false;
            }
            for (int i = 0; i < name.Length; i++)
            {
                if (filter[i + 1] != name[i])
                {
                    return false;
                }
            }
            return true;
        }

        private static bool TryHex(byte[] from, int at, out ulong number)
        {
            number = 0;
            for (int i = at; i < at + 16; i++)
            {
                int digit = from[i] >= '0' && from[i] <= '9' ? from[i] - '0'
                    : from[i] >= 'a' && from[i] <= 'f' ? from[i] - 'a' + 10
                    : from[i] >= 'A' && from[i] <= 'F' ? from[i] - 'A' + 10 : -1;
                if (digit < 0)
                {
                    return false;
                }
                number = number << 4 | (uint)digit;
            }
            return true;
        }
    }
}
