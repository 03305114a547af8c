using System;
using System.Collections.Generic;
using Nep.Session;
using Nep.Wire;

namespace Nep
{
    /// <summary>Publisher of one topic, created by <see cref="Node.CreatePublisher(string, string, PublisherOptions)"/>. Thread-safe.</summary>
    /// <example>
    /// <code>
    /// using (var node = new Node("sender"))
    /// using (Publisher publisher = node.CreatePublisher("example"))
    /// {
    ///     publisher.Publish(new { message = "hello" });
    /// }
    /// </code>
    /// </example>
    public sealed partial class Publisher : IDisposable
    {
        private readonly PublisherSocket _socket;
        private readonly Codec _codec;
        private readonly Node _node;

        internal Publisher(Node node, PublisherSocket socket, Codec codec, IList<string> missing)
        {
            _node = node;
            _socket = socket;
            _codec = codec;
            UnconnectedSubscribers = missing;
        }

        /// <summary>Name of the topic.</summary>
        public string Topic
        {
            get { return _socket.Record.Topic; }
        }

        /// <summary>Type under which the topic is registered, such as <c>json</c>.</summary>
        public string Type
        {
            get { return _socket.Record.MsgType; }
        }

        /// <summary>Number of messages published so far.</summary>
        public long Count
        {
            get { return (long)_socket.LastSeq; }
        }

        /// <summary>Number of connected subscribers.</summary>
        public int SubscriberCount
        {
            get { return _socket.SubscriberCount; }
        }

        /// <summary>Number of messages not sent to a subscriber because too many bytes were in flight, summed over all subscribers.</summary>
        public long Dropped
        {
            get { return _socket.Dropped; }
        }

        /// <summary>Names of subscribed nodes that did not connect within 0.5 s when the publisher was created.</summary>
        public IList<string> UnconnectedSubscribers { get; private set; }

        /// <summary>Publish a message. Returns immediately; messages for a subscriber that is too slow are dropped and counted.</summary>
        /// <param name="payload">
        /// For <c>json</c> any object that the JSON serializer supports; for <c>string</c> a string; for <c>bytes</c> and <c>image</c> a byte[];
        /// for <c>msgpack</c> plain values, lists and dictionaries.
        /// </param>
        /// <exception cref="PayloadException">The payload can't be encoded; nothing is sent.</exception>
        /// <exception cref="ObjectDisposedException">The publisher is closed.</exception>
        public void Publish(object payload)
        {
            if (_codec.Number == 5)
            {
                PublishImage(payload as byte[] ?? new byte[0]);
                return;
            }
            byte[] encoded;
            try
            {
                encoded = _codec.Encode(payload);
            }
            catch (PayloadException exception)
            {
                _socket.Problem = exception.Message;
                throw;
            }
            _socket.Send(encoded, null);
        }

        /// <summary>Publish existing JSON text. The text is not validated completely.</summary>
        /// <param name="json">JSON text, nested at most 64 levels deep.</param>
        /// <exception cref="PayloadException">The topic has another codec, or the text is truncated or nested too deep.</exception>
        /// <exception cref="ObjectDisposedException">The publisher is closed.</exception>
        public void PublishJson(string json)
        {
            if (_codec.Number != 1)
            {
                throw new PayloadException("A topic of type '" + _codec.Name + "' doesn't accept JSON.");
            }
            _socket.Send(Codec.CheckedJson(json), null);
        }

        /// <summary>Publish a JPEG or PNG file on a topic of type <c>image</c>.</summary>
        /// <param name="file">Bytes of the file, which are copied.</param>
        /// <exception cref="PayloadException">The topic has another type, or the file is neither JPEG nor PNG.</exception>
        /// <exception cref="ObjectDisposedException">The publisher is closed.</exception>
        public void PublishImage(byte[] file)
        {
            if (_codec.Number != 5)
            {
                throw new PayloadException("A topic of type '" + _codec.Name + "' doesn't accept images.");
            }
            byte[] extension = MessagePackWriter.Write(ImageHeader.Describe(file));
            _socket.Send(_codec.Encode(file), extension);
        }

        /// <summary>Close the publisher after subscribers have received all messages, within <see cref="NodeOptions.CloseTimeout"/>.</summary>
        public void Close()
        {
            _node.Close(_socket);
        }

        /// <summary>Same as <see cref="Close"/>.</summary>
        public void Dispose()
        {
            Close();
        }
    }
}
