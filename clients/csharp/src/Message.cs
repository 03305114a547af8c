using System;
using System.Collections.Generic;
using System.Text;
using Nep.Wire;

namespace Nep
{
    /// <summary>A received message. Immutable; decoded when its value is asked for.</summary>
    public sealed class Message
    {
        private readonly WireMessage _wire;
        private readonly Session.PublisherClock _clock;
        private readonly ulong _receivedNs;
        private byte[] _payload;

        /// <param name="wire">The message as it was read.</param>
        /// <param name="messageType">Type that its publisher declared.</param>
        /// <param name="clock">Clock of its publisher, or null.</param>
        internal Message(WireMessage wire, string messageType, Session.PublisherClock clock)
        {
            _wire = wire;
            _clock = clock;
            _receivedNs = Session.Clock.NowNs;
            MessageType = messageType;
        }

        /// <summary>Topic that it was published on.</summary>
        public string Topic
        {
            get { return _wire.Topic; }
        }

        /// <summary>Type that its publisher declared, such as <c>json</c> or <c>sensor_msgs/Image</c>.</summary>
        public string MessageType { get; private set; }

        /// <summary>How the payload is encoded: <c>json</c>, <c>string</c>, <c>bytes</c>, <c>msgpack</c> or <c>image</c>.</summary>
        public string Codec
        {
            get { return Nep.Codec.NameOf(_wire.Header.Codec); }
        }

        /// <summary>Number of the message; its publisher counts from 1 without gaps.</summary>
        public ulong Sequence
        {
            get { return _wire.Header.Seq; }
        }

        /// <summary>When it was published, by the publisher's clock, in nanoseconds since 1970 (UTC).</summary>
        public ulong StampNanoseconds
        {
            get { return _wire.Header.StampNs; }
        }

        /// <summary>When it was published, by the publisher's clock (UTC), to 100 ns.</summary>
        public DateTime Stamp
        {
            get { return Session.Clock.ToDateTime(_wire.Header.StampNs); }
        }

        /// <summary>
        /// Time from its publication until it was received. Between two computers it is corrected by how their clocks differ, as far
        /// as <see cref="LatencyUncertainty"/> says; so it may be a little below zero.
        /// </summary>
        public TimeSpan Latency
        {
            get
            {
                Session.ClockDifference known = _clock == null ? null : _clock.Difference;
                decimal ns = (decimal)_receivedNs - _wire.Header.StampNs - (known == null ? 0 : known.AddNs);
                decimal ticks = Math.Max(long.MinValue, Math.Min(long.MaxValue, decimal.Floor(ns / 100)));
                return new TimeSpan((long)ticks);
            }
        }

        /// <summary>
        /// How far <see cref="Latency"/> may be wrong to either side: zero for publishers on this computer, null while nobody has
        /// compared the two clocks; then it is not corrected.
        /// </summary>
        public TimeSpan? LatencyUncertainty
        {
            get
            {
                Session.ClockDifference known = _clock == null ? null : _clock.Difference;
                return known == null ? (TimeSpan?)null : new TimeSpan(known.UncertaintyNs / 100);
            }
        }

        /// <summary>Id of the publisher.</summary>
        public ulong PublisherId
        {
            get { return _wire.Header.Publisher; }
        }

        /// <summary>Whether its publisher sends it to later subscribers as well.</summary>
        public bool IsLatched
        {
            get { return (_wire.Header.Flags & Header.Latched) != 0; }
        }

        /// <summary>Bytes of the payload.</summary>
        public int Size
        {
            get { return _wire.Payload.Count; }
        }

        /// <summary>Data beside the payload, such as <c>shape</c> and <c>encoding</c> of an image; empty when there is none.</summary>
        public IDictionary<string, object> Extension
        {
            get { return _wire.Extension ?? new Dictionary<string, object>(); }
        }

        /// <summary>The payload as it was received. Don't change it.</summary>
        public byte[] Payload
        {
            get
            {
                if (_payload == null)
                {
                    ArraySegment<byte> from = _wire.Payload;
                    if (from.Offset == 0 && from.Count == from.Array.Length)
                    {
                        _payload = from.Array;
                    }
                    else
                    {
                        var copy = new byte[from.Count];
                        Buffer.BlockCopy(from.Array, from.Offset, copy, 0, copy.Length);
                        _payload = copy;
                    }
                }
                return _payload;
            }
        }

        /// <summary>Text of a <c>string</c> or <c>json</c> message.</summary>
        /// <exception cref="PayloadException">It has another codec or is no UTF-8.</exception>
        public string Text
        {
            get
            {
                if (_wire.Header.Codec > 2)
                {
                    throw new PayloadException("A message of codec '" + Codec + "' is no text.");
                }
                try
                {
                    return Names.StrictUtf8.GetString(_wire.Payload.Array, _wire.Payload.Offset, _wire.Payload.Count);
                }
                catch (DecoderFallbackException exception)
                {
                    throw new PayloadException("The text of the message is no UTF-8.", exception);
                }
            }
        }

        /// <summary>Convert a <c>json</c> message to an object of a class.</summary>
        /// <typeparam name="T">Class with public properties or fields named as in the JSON, or a dictionary or list.</typeparam>
        /// <exception cref="PayloadException">It is no JSON, is nested too deeply, or does not fit the type.</exception>
        /// <example><code>Pose pose = message.As&lt;Pose&gt;();</code></example>
        public T As<T>()
        {
            if (_wire.Header.Codec != 1)
            {
                object value = Value;
                if (value is T)
                {
                    return (T)value;
                }
                throw new PayloadException("A message of codec '" + Codec + "' can't be converted to " + typeof(T).Name + ".");
            }
            Json.Check(_wire.Payload.Array, _wire.Payload.Offset, _wire.Payload.Count);
            string text = Text;
            try
            {
                return (T)Json.Serializer.Deserialize(text, typeof(T));
            }
            catch (Exception exception) // each library has its own
            {
                throw new PayloadException("The JSON can't be converted to " + typeof(T).Name + ": " + exception.Message, exception);
            }
        }

        /// <summary>
        /// Decoded payload: what the JSON serializer makes of <c>json</c>, a string, byte[], or plain values of <c>msgpack</c>
        /// (long, ulong, double, bool, string, byte[], DateTime, List&lt;object&gt;, Dictionary&lt;object, object&gt;).
        /// </summary>
        /// <exception cref="PayloadException">It can't be decoded.</exception>
        public object Value
        {
            get
            {
                switch (_wire.Header.Codec)
                {
                    case 1:
                        return As<object>();
                    case 2:
                        return Text;
                    case 4:
                        try
                        {
                            return MessagePackReader.ReadOnly(_wire.Payload);
                        }
                        catch (FormatException exception)
                        {
                            throw new PayloadException("The message is no msgpack: " + exception.Message, exception);
                        }
                    default:
                        return Payload;
                }
            }
        }
    }
}
