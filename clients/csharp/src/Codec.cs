using System;
using System.Text;
using Nep.Wire;

namespace Nep
{
    /// <summary>Encoder and decoder of payloads.</summary>
    internal sealed class Codec
    {
        private static readonly string[] CodecNames = { "", "json", "string", "bytes", "msgpack", "image" };

        private Codec(byte number)
        {
            Number = number;
        }

        public byte Number { get; private set; }

        public string Name
        {
            get { return NameOf(Number); }
        }

        public static string NameOf(byte number)
        {
            return CodecNames[number];
        }

        /// <summary>Return the codec of a message type; types without a codec are encoded as JSON.</summary>
        public static Codec For(string type)
        {
            int number = type == "images" ? 5 : Array.IndexOf(CodecNames, type);
            return new Codec((byte)(number < 1 ? 1 : number));
        }

        /// <summary>Return the codec of a call or reply; null if the number is unknown.</summary>
        public static Codec Numbered(int number)
        {
            return number >= 1 && number <= 4 ? new Codec((byte)number) : null;
        }

        /// <exception cref="PayloadException">The payload can't be decoded, or has another type.</exception>
        public T Decode<T>(byte[] payload)
        {
            var header = new Header { Codec = Number };
            return new Message(new WireMessage { Header = header, Payload = new ArraySegment<byte>(payload) }, Name, null).As<T>();
        }

        /// <exception cref="PayloadException">The payload can't be encoded.</exception>
        public byte[] Encode(object payload)
        {
            switch (Number)
            {
                case 1:
                    return EncodeJson(payload);
                case 2:
                    return EncodeText(payload as string);
                case 4:
                    try
                    {
                        return MessagePackWriter.Write(payload);
                    }
                    catch (NotSupportedException exception)
                    {
                        throw new PayloadException(exception.Message, exception);
                    }
                default:
                    var bytes = payload as byte[];
                    if (bytes == null)
                    {
                        throw new PayloadException("A topic of type '" + Name + "' requires byte[].");
                    }
                    return (byte[])bytes.Clone(); // the caller may reuse its array
            }
        }

        private static byte[] EncodeText(string text)
        {
            if (text == null)
            {
                throw new PayloadException("A topic of type 'string' requires a string.");
            }
            return Encoding.UTF8.GetBytes(text);
        }

        private static byte[] EncodeJson(object payload)
        {
            string text;
            try
            {
                text = Json.Serializer.Serialize(payload);
            }
            catch (Exception exception) // depends on the serializer
            {
                throw new PayloadException("The payload can't be converted to JSON: " + exception.Message, exception);
            }
            return CheckedJson(text);
        }

        /// <summary>Encode and check JSON text.</summary>
        public static byte[] CheckedJson(string text)
        {
            byte[] bytes = Encoding.UTF8.GetBytes(text);
            Json.Check(bytes, 0, bytes.Length);
            return bytes;
        }
    }
}
