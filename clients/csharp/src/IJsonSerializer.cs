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

        /// <summary>Whether lists and objects are nested more deeply than the wire allows.</summary>
        internal static bool IsTooDeep(byte[] json, int offset, int count)
        {
            int level = 0;
            bool isText = false;
            for (int i = offset; i < offset + count; i++)
            {
                byte each = json[i];
                if (isText)
                {
                    if (each == '\\')
                    {
                        i++;
                    }
                    else if (each == '"')
                    {
                        isText = false;
                    }
                }
                else if (each == '"')
                {
                    isText = true;
                }
                else if (each == '[' || each == '{')
                {
                    if (++level > Wire.MessagePackReader.MaxLevels)
                    {
                        return true;
                    }
                }
                else if (each == ']' || each == '}')
                {
                    level--;
                }
            }
            return false;
        }
    }
}
