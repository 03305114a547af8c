using System;

namespace Nep
{
    /// <summary>Converts objects to and from JSON. Implementations must be thread-safe.</summary>
    /// <remarks>
    /// Set <see cref="Json.Serializer"/> to use another library than Newtonsoft.Json, for instance one that generates its code
    /// ahead of time.
    /// </remarks>
    public interface IJsonSerializer
    {
        /// <summary>Convert an object to JSON text. NaN and infinity become <c>null</c>.</summary>
        /// <param name="value">Object, dictionary, list or plain value; may be null.</param>
        string Serialize(object value);

        /// <summary>Convert JSON text to an object.</summary>
        /// <param name="json">JSON text.</param>
        /// <param name="type">Type to create.</param>
        object Deserialize(string json, Type type);
    }

    /// <summary>JSON library that publishers and messages use.</summary>
    public static class Json
    {
        private static IJsonSerializer _serializer = new NewtonsoftJsonSerializer();

        /// <summary>Serializer of this process. Default: Newtonsoft.Json.</summary>
        /// <exception cref="ArgumentNullException">The value is null.</exception>
        public static IJsonSerializer Serializer
        {
            get { return _serializer; }
            set
            {
                if (value == null)
                {
                    throw new ArgumentNullException("value");
                }
                _serializer = value;
            }
        }

        /// <summary>Check what serializers accept silently: too many levels, an end that comes too early, nothing at all.</summary>
        /// <exception cref="PayloadException">The bytes are not one JSON value with at most 64 levels.</exception>
        internal static void Check(byte[] json, int offset, int count)
        {
            int level = 0;
            bool isText = false, isEmpty = true;
            for (int i = offset; i < offset + count; i++)
            {
                byte each = json[i];
                isEmpty &= each <= ' ';
                if (isText)
                {
                    i += each == '\\' ? 1 : 0;
                    isText = each != '"';
                }
                else if (each == '"')
                {
                    isText = true;
                }
                else if (each == '[' || each == '{')
                {
                    if (++level > Wire.MessagePackReader.MaxLevels)
                    {
                        throw new PayloadException("The JSON has more than 64 levels of lists and objects.");
                    }
                }
                else if (each == ']' || each == '}')
                {
                    level--;
                }
            }
            if (level != 0 || isText || isEmpty)
            {
                throw new PayloadException("The JSON ends too early.");
            }
        }
    }
}
