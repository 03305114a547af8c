using System;
using System.Globalization;
using System.IO;
using Newtonsoft.Json;

namespace Nep
{
    /// <summary>Serializer that uses Newtonsoft.Json. Dates are not converted; NaN and infinity become <c>null</c>.</summary>
    public sealed class NewtonsoftJsonSerializer : IJsonSerializer
    {
        private readonly JsonSerializer _serializer;

        /// <summary>Create a serializer with the default settings.</summary>
        public NewtonsoftJsonSerializer() : this(new JsonSerializerSettings { DateParseHandling = DateParseHandling.None })
        {
        }

        /// <summary>Create a serializer with custom settings, such as converters.</summary>
        /// <param name="settings">Settings, which must not be changed afterwards.</param>
        public NewtonsoftJsonSerializer(JsonSerializerSettings settings)
        {
            _serializer = JsonSerializer.Create(settings);
        }

        /// <inheritdoc />
        public string Serialize(object value)
        {
            var text = new StringWriter(CultureInfo.InvariantCulture);
            using (var writer = new FiniteJsonWriter(text))
            {
                _serializer.Serialize(writer, value);
            }
            return text.ToString();
        }

        /// <inheritdoc />
        public object Deserialize(string json, Type type)
        {
            using (var reader = new JsonTextReader(new StringReader(json)))
            {
                object value = _serializer.Deserialize(reader, type);
                if (reader.Read())
                {
                    throw new JsonReaderException("the JSON value is followed by other text");
                }
                return value;
            }
        }

        /// <summary>Writer that replaces NaN and infinity, which JSON lacks, by null.</summary>
        private sealed class FiniteJsonWriter : JsonTextWriter
        {
            public FiniteJsonWriter(TextWriter writer) : base(writer)
            {
            }

            public override void WriteValue(double value)
            {
                if (double.IsNaN(value) || double.IsInfinity(value))
                {
                    WriteNull();
                }
                else
                {
                    base.WriteValue(value);
                }
            }

            public override void WriteValue(float value)
            {
                if (float.IsNaN(value) || float.IsInfinity(value))
                {
                    WriteNull();
                }
                else
                {
                    base.WriteValue(value);
                }
            }
        }
    }
}
