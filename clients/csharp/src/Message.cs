using System;
using System.Collections.Generic;
using System.Text;
using Nep.Wire;

namespace Nep
{
    /// <summary>Received message. Immutable; decoded when its value is read.</summary>
    public sealed class Message
    {
        private readonly WireMessage _wire;
        private readonly Session.PublisherClock _clock;
        private readonly ulong _receivedNs;
        private byte[] _payload;

        /// <param name="wire">Message of the wire.</param>
        /// <param name="messageType">Type declared by the publisher.</param>
        /// <param name="clock">Clock of the publisher, or null.</param>
        internal Message(WireMessage wire, string messageType, Session.PublisherClock clock)
        {
            _wire = wire;
            _clock = clock;
            _receivedNs = Session.Clock.NowNs;
            MessageType = messageType;
        }

        /// <summary>Topic on which the message was published.</summary>
        public string Topic
        {
            get { return _wire.Topic; }
        }

        /// <summary>Type declared by the publisher, such as <c>json</c> or <c>sensor_msgs/Image</c>.</summary>
        public string MessageType { get; private set; }

        /// <summary>Codec of the payload: <c>json</c>, <c>string</c>, <c>bytes</c>, <c>msgpack</c> or <c>image</c>.</summary>
        public string Codec
        {
            get { return Nep.Codec.NameOf(_wire.Header.Codec); }
        }

        /// <summary>Sequence number, counted from 1 by the publisher.</summary>
        public ulong Sequence
        {
            get { return _wire.Header.Seq; }
        }

        /// <summary>Time of publication by the publisher's clock, in nanoseconds since 1970 (UTC).</summary>
        public ulong StampNanoseconds
        {
            get { return _wire.Header.StampNs; }
        }

        /// <summary>Time of publication by the publisher's clock (UTC), with a resolution of 100 ns.</summary>
        public DateTime Stamp
        {
            get { return Session.Clock.ToDateTime(_wire.Header.StampNs); }
        }

        /// <summary>
        /// Time from publication to reception. Between two computers it is corrected by the difference of their clocks, with the
        /// uncertainty <see cref="LatencyUncertainty"/>, so it may be slightly negative.
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
        /// Maximum error of <see cref="Latency"/>: zero for publishers on this computer, null while the difference of the clocks is
        /// unknown and the latency is not corrected.
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

        /// <summary>True if the publisher keeps the message for late subscribers.</summary>
        public bool IsLatched
        {
            get { return (_wire.Header.Flags & Header.Latched) != 0; }
        }

        /// <summary>Size of the payload in bytes.</summary>
        public int Size
        {
            get { return _wire.Payload.Count; }
        }

        /// <summary>Named values sent with the payload, such as <c>shape</c> and <c>encoding</c> of an image; empty if there are none.</summary>
        public IDictionary<string, object> Extension
        {
            get { return _wire.Extension ?? new Dictionary<string, object>(); }
        }

        /// <summary>Received payload. Don't modify it.</summary>
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
        /// <exception cref="PayloadException">The message has another codec, or isn't valid UTF-8.</exception>
        public string Text
        {
            get
            {
                if (_wire.Header.Codec > 2)
                {
                    throw new PayloadException("A message with the codec '" + Codec + "' isn't text.");
                }
                try
                {
                    return Names.StrictUtf8.GetString(_wire.Payload.Array, _wire.Payload.Offset, _wire.Payload.Count);
                }
                catch (DecoderFallbackException exception)
                {
                    throw new PayloadException("The text of the message is not valid UTF-8.", exception);
                }
            }
        }

        /// <summary>Convert a <c>json</c> message to an object.</summary>
        /// <typeparam name="T">Class with public properties or fields named as in the JSON, or a dictionary or list.</typeparam>
        /// <exception cref="PayloadException">The JSON is invalid, nested too deep, or doesn't match the type.</exception>
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
                throw new PayloadException("A message with the codec '" + Codec + "' can't be converted to " + typeof(T).Name + ".");
            }
            Json.Check(_wire.Payload.Array, _wire.Payload.Offset, _wire.Payload.Count);
            string text = Text;
            try
            {
                return (T)Json.Serializer.Deserialize(text, typeof(T));
            }
            catch (Exception exception) // depends on the serializer
            {
                throw new PayloadException("The JSON can't be converted to " + typeof(T).Name + ": " + exception.Message, exception);
            }
        }

        /// <summary>
        /// Decoded payload: the result of the JSON serializer for <c>json</c>, a string, byte[], or plain values for <c>msgpack</c>
        /// (long, ulong, double, bool, string, byte[], DateTime, List&lt;object&gt;, Dictionary&lt;object, object&gt;).
        /// </summary>
        /// <exception cref="PayloadException">The payload can't be decoded.</exception>
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
                            throw new PayloadException("The message is not valid msgpack: " + exception.Message, exception);
                        }
                    default:
                        return Payload;
                }
            }
        }
    }
}
