using System;
using System.Text;

namespace Nep.Wire
{
    /// <summary>Grammar of topics and node names.</summary>
    internal static class Names
    {
        public const int MaxBytes = 200;
        public static readonly Encoding StrictUtf8 = new UTF8Encoding(false, true);

        public static bool IsTopic(string name)
        {
            if (!IsNodeName(name))
            {
                return false;
            }
            foreach (char each in name)
            {
                if (each == '{' || IsSpace(each))
                {
                    return false;
                }
            }
            return true;
        }

        public static bool IsNodeName(string name)
        {
            if (string.IsNullOrEmpty(name))
            {
                return false;
            }
            foreach (char each in name)
            {
                if (IsControl(each))
                {
                    return false;
                }
            }
            try
            {
                return StrictUtf8.GetByteCount(name) <= MaxBytes;
            }
            catch (EncoderFallbackException)
            {
                return false;
            }
        }

        private static bool IsSpace(char each)
        {
            return each >= '\t' && each <= '\r' || each >= '\x1C' && each <= ' ' || each == '\x85' || each == '\xA0' || each == '\u1680'
                || each >= '\u2000' && each <= '\u200A' || each == '\u2028' || each == '\u2029' || each == '\u202F' || each == '\u205F'
                || each == '\u3000';
        }

        private static bool IsControl(char each)
        {
            return each <= '\x1F' || each >= '\x7F' && each <= '\x9F' || each == '\u061C' || each == '\u200B' || each == '\u200E'
                || each == '\u200F' || each >= '\u2028' && each <= '\u202E' || each >= '\u2060' && each <= '\u206F' || each == '\uFEFF'
                || each >= '\uFFF9' && each <= '\uFFFB';
        }

        /// <summary>Return the topic part: the name and a zero byte.</summary>
        public static byte[] TopicPart(string topic)
        {
            var part = new byte[StrictUtf8.GetByteCount(topic) + 1];
            StrictUtf8.GetBytes(topic, 0, topic.Length, part, 0);
            return part;
        }

        /// <exception cref="WireException">The topic part is malformed.</exception>
        public static string ReadTopicPart(byte[] part, int count)
        {
            if (count == 0 || part[count - 1] != 0)
            {
                throw new WireException("topic-end");
            }
            try
            {
                string topic = StrictUtf8.GetString(part, 0, count - 1);
                if (IsTopic(topic))
                {
                    return topic;
                }
            }
            catch (DecoderFallbackException)
            {
            }
            throw new WireException("topic");
        }
    }
}
