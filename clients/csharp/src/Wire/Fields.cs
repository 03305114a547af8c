using System;
using System.Collections.Generic;

namespace Nep.Wire
{
    /// <summary>Typed access to a map of a reply or push. Unknown fields are ignored; missing ones have a default.</summary>
    internal sealed class Fields
    {
        private static readonly List<object> NoList = new List<object>();
        private readonly Dictionary<object, object> _map;

        public Fields(object map)
        {
            _map = map as Dictionary<object, object>;
            if (_map == null)
            {
                throw new WireException("field-type");
            }
        }

        public static Fields Of(ArraySegment<byte> body)
        {
            object value;
            try
            {
                value = MessagePackReader.ReadOnly(body);
            }
            catch (FormatException)
            {
                throw new WireException("msgpack");
            }
            if (!(value is Dictionary<object, object>))
            {
                throw new WireException("map");
            }
            return new Fields(value);
        }

        public bool Has(string name)
        {
            object value;
            return _map.TryGetValue(name, out value) && value != null;
        }

        public string Text(string name, string missing)
        {
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                return Missing(missing);
            }
            var text = value as string;
            if (text == null)
            {
                throw new WireException("field-type");
            }
            return text;
        }

        private static string Missing(string missing)
        {
            if (missing == null)
            {
                throw new WireException("field-missing");
            }
            return missing;
        }

        public ulong Unsigned(string name, ulong missing)
        {
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                return missing;
            }
            return ToUnsigned(value);
        }

        public static ulong ToUnsigned(object value)
        {
            if (value is ulong)
            {
                return (ulong)value;
            }
            if (!(value is long))
            {
                throw new WireException("field-type");
            }
            return (long)value < 0 ? 0 : (ulong)(long)value;
        }

        public bool Flag(string name)
        {
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                return false;
            }
            if (!(value is bool))
            {
                throw new WireException("field-type");
            }
            return (bool)value;
        }

        public double Number(string name, double missing)
        {
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                return missing;
            }
            if (!(value is long) && !(value is ulong) && !(value is double))
            {
                throw new WireException("field-type");
            }
            return Convert.ToDouble(value, System.Globalization.CultureInfo.InvariantCulture);
        }

        public Fields Map(string name)
        {
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                throw new WireException("field-missing");
            }
            return new Fields(value);
        }

        public List<object> List(string name)
        {
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                return NoList;
            }
            var list = value as List<object>;
            if (list == null)
            {
                throw new WireException("field-type");
            }
            return list;
        }

        public List<string> Texts(string name)
        {
            var texts = new List<string>();
            foreach (object each in List(name))
            {
                var text = each as string;
                if (text == null)
                {
                    throw new WireException("field-type");
                }
                texts.Add(text);
            }
            return texts;
        }

        public List<long> Integers(string name)
        {
            return ToIntegers(List(name));
        }

        /// <summary>Return a map with text keys and lists of integers, such as <c>clocks</c>.</summary>
        public Dictionary<string, List<long>> IntegersByText(string name)
        {
            var lists = new Dictionary<string, List<long>>();
            if (Has(name))
            {
                foreach (KeyValuePair<object, object> each in Map(name)._map)
                {
                    var key = each.Key as string;
                    var list = each.Value as List<object>;
                    if (key == null || list == null)
                    {
                        throw new WireException("field-type");
                    }
                    lists[key] = ToIntegers(list);
                }
            }
            return lists;
        }

        private static List<long> ToIntegers(List<object> list)
        {
            if (!list.TrueForAll(each => each is long))
            {
                throw new WireException("field-type");
            }
            return list.ConvertAll(each => (long)each);
        }

        /// <summary>Return a map with integer keys, such as <c>last_seqs</c>.</summary>
        public Dictionary<ulong, ulong> Numbers(string name)
        {
            var numbers = new Dictionary<ulong, ulong>();
            object value;
            if (!_map.TryGetValue(name, out value))
            {
                return numbers;
            }
            var map = value as Dictionary<object, object>;
            if (map == null)
            {
                throw new WireException("field-type");
            }
            foreach (KeyValuePair<object, object> each in map)
            {
                numbers[ToUnsigned(each.Key)] = ToUnsigned(each.Value);
            }
            return numbers;
        }
    }
}
