using System;

namespace Nep
{
    /// <summary>Converter between objects and JSON. Implementations must be thread-safe.</summary>
    /// <remarks>
    /// Set <see cref="Json.Serializer"/> to use another library than Newtonsoft.Json, for example one that generates code ahead
    /// of time.
    /// </remarks>
    public interface IJsonSerializer
    {
        /// <summary>Convert an object to JSON text. NaN and infinity become <c>null</c>.</summary>
        /// <param name="value">Object, dictionary, list, plain value or null.</param>
        string Serialize(object value);

        /// <summary>Convert JSON text to an object.</summary>
        /// <param name="json">JSON text.</param>
        /// <param name="type">Type to create.</param>
        object Deserialize(string json, Type type);
    }

    /// <summary>JSON library used by publishers and messages.</summary>
    public static class Json
    {
        private static IJsonSerializer _serializer = new NewtonsoftJsonSerializer();

        /// <summary>Serializer used by the process. Default: Newtonsoft.Json.</summary>
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

        /// <summary>Check for errors that serializers ignore: too deep nesting, truncated and empty JSON.</summary>
        /// <exception cref="PayloadException">The JSON is empty, truncated, or nested more than 64 levels deep.</exception>
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
                        throw new PayloadException("The JSON is nested more than 64 levels deep.");
                    }
                }
                else if (each == ']' || each == '}')
                {
                    level--;
                }
            }
            if (level != 0 || isText || isEmpty)
            {
                throw new PayloadException("The JSON is truncated.");
            }
        }
    }
}
